"""The other end of a ping-pong: sends back 60 bytes for every message. `python -m tests.bench.echo KIND ADDRESS`."""

import socket
import sys

import zenoh

from bridge.wire import realtime
from bridge.wire.zenoh_link import BusConfig, session_config

ANSWER = bytes(60)  # a Command


def over_zenoh(endpoint: str) -> None:
    """Answer on a bare Zenoh session until the other side leaves."""
    with zenoh.open(session_config(BusConfig(endpoint=endpoint), hub=False, lockstep=False)) as session:
        answers = session.declare_publisher("bench/pong", priority=zenoh.Priority.REAL_TIME, express=True)
        pings = session.declare_subscriber("bench/ping")
        realtime.claim(1)
        session.declare_publisher("bench/ready").put(b"")
        while len(pings.recv().payload) > 0:
            answers.put(ANSWER)


def over_a_socket(path: str) -> None:
    """Answer on a raw Unix socket until it closes."""
    with socket.socket(socket.AF_UNIX) as end:
        end.connect(path)
        realtime.claim(1)
        while end.recv(4096):
            end.send(ANSWER)


if __name__ == "__main__":
    {"zenoh": over_zenoh, "socket": over_a_socket}[sys.argv[1]](sys.argv[2])
