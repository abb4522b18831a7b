"""Bare ping-pongs between two processes: 428 bytes there, 60 back, paced at 1 kHz, with the priority and cores of the loop.

`measure` starts both ends, `python -m tests.speed.ping_pong END KIND ADDRESS PINGS FILE`.
"""

import os
import queue
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.kernel import kernel
from bridge.wire import realtime
from tests.system.ports import free_endpoint

PING, PONG = bytes(428), bytes(60)  # a SensorBlock, a Command
_DEFAULT = "()"  # Zenoh's own threads; without it `bridge.wire.zenoh_link` sets one thread
_START_S = 60.0  # a first start compiles

# the medium of a ping-pong; see `_ends`
PLAIN, SETTINGS, CHANNEL = "zenoh-callback", "zenoh-settings", "zenoh-channel"
SOCKET, MEMORY = "socket", "memory"
NAMES = {
    PLAIN: "Zenoh, plain callback, default threads",
    SETTINGS: "Zenoh, callback, our settings",
    CHANNEL: "Zenoh, `recv`, default threads",
    SOCKET: "Unix socket",
    MEMORY: "shared memory, polled",
}

Nanoseconds = npt.NDArray[np.float64]


class End(NamedTuple):
    """One end of a ping-pong."""

    send: Callable[[], Any]
    receive: Callable[[], Any]  # waits for the other end; a false value ends the echo
    close: Callable[[], Any]


def measure(kind: str, pings: int) -> Nanoseconds:
    """Round trips [ns], of `pings` at 1000 a second, between two separate processes, which keep their priorities."""
    environment = dict(os.environ)
    if kind in {PLAIN, CHANNEL}:
        environment["ZENOH_RUNTIME"] = _DEFAULT
    with tempfile.TemporaryDirectory() as folder:
        result = Path(folder) / "ns.npy"
        address = free_endpoint() if kind.startswith("zenoh") else str(Path(folder) / kind)
        words = (kind, address, str(pings), str(result))
        command = [sys.executable, "-m", "tests.speed.ping_pong"]
        ends = [subprocess.Popen([*command, end, *words], env=environment) for end in ("ping", "echo")]
        try:
            for end in ends:
                end.wait(_START_S + pings * 1e-3)
            return np.load(result)
        finally:
            for end in ends:
                end.kill()
                end.wait()


def _ping(kind: str, address: str, pings: int, result: str) -> None:
    if kind == MEMORY:
        np.save(result, _ping_memory(address, pings))
        return
    end = _end(kind, address, first=True)
    end.receive()  # the other end is there
    time.sleep(0.5)
    realtime.claim(realtime.core(0))
    pacer = realtime.Pacer(1_000_000)
    took_ns = np.empty(pings)
    for number in range(pings):
        pacer.wait(number)
        sent_ns = time.perf_counter_ns()
        end.send()
        end.receive()
        took_ns[number] = time.perf_counter_ns() - sent_ns
    np.save(result, took_ns)
    end.close()


def _echo(kind: str, address: str, pings: int) -> None:
    if kind == MEMORY:
        _echo_memory(address, pings)
        return
    end = _end(kind, address, first=False)
    realtime.claim(realtime.core(1))
    end.send()  # here
    for _ in range(pings):
        end.receive()
        end.send()
    end.receive()  # the other one closes
    end.close()


def _end(kind: str, address: str, first: bool) -> End:
    if kind == SOCKET:
        return _socket_end(address, first)
    return _zenoh_end(kind, address, first)


def _zenoh_end(kind: str, endpoint: str, first: bool) -> End:
    import zenoh

    from bridge.wire.zenoh_link import BusConfig, _keep_thread_state, session_config

    config = session_config(BusConfig(endpoint=endpoint), hub=first, lockstep=False)
    until_s = time.monotonic() + _START_S
    while True:
        try:
            session = zenoh.open(config)
            break
        except zenoh.ZError:
            if time.monotonic() > until_s:
                raise
            time.sleep(0.05)
    mine, other = ("bench/ping", "bench/pong") if first else ("bench/pong", "bench/ping")
    # the fastest queue, as the bus is measured
    arrived: queue.SimpleQueue[bytes] = queue.SimpleQueue()  # noqa: TID251

    def on_sample(sample: Any) -> None:
        if kind == SETTINGS:
            _keep_thread_state()
        arrived.put(sample.payload.to_bytes())

    if kind == CHANNEL:
        channel = session.declare_subscriber(other)

        def receive() -> bytes:
            return channel.recv().payload.to_bytes()

    else:
        kept = session.declare_subscriber(other, zenoh.handlers.Callback(on_sample, indirect=False))

        def receive(_kept: Any = kept) -> bytes:
            return arrived.get(timeout=_START_S)

    publisher = session.declare_publisher(mine, priority=zenoh.Priority.REAL_TIME, express=True)
    message = PING if first else PONG

    def close() -> None:
        if first:
            publisher.put(b"")
        else:
            session.close()

    if not first:
        time.sleep(0.5)  # the other end has heard of the subscription
    return End(lambda: publisher.put(message), receive, close)


def _socket_end(path: str, first: bool) -> End:
    if first:
        with socket.socket(socket.AF_UNIX) as listener:
            listener.bind(path)
            listener.listen()
            end, _ = listener.accept()
    else:
        end = socket.socket(socket.AF_UNIX)
        until_s = time.monotonic() + _START_S
        while True:
            try:
                end.connect(path)
                break
            except OSError:
                if time.monotonic() > until_s:
                    raise
                time.sleep(0.05)
    message = PING if first else PONG
    return End(lambda: end.send(message), lambda: end.recv(4096), end.close)


@kernel
def _await(cell: npt.NDArray[np.int64], place: int, value: int, looks: int) -> bool:
    """Poll until the cell holds the value; False after so many looks."""
    for _ in range(looks):  # noqa: SIM110
        if cell[place] == value:
            return True
    return False


@kernel
def _answer(cell: npt.NDArray[np.int64], pings: int, looks: int) -> bool:
    for number in range(1, pings + 1):
        if not _await(cell, 0, number, looks):
            return False
        cell[8] = number  # on a separate cache line
    return True


def _memory(path: str) -> npt.NDArray[np.int64]:
    return np.memmap(path, np.int64, "r+", shape=16)


_LOOKS = 10**11  # half a minute: the other end has gone by then


def _ping_memory(path: str, pings: int) -> Nanoseconds:
    beside = Path(path).with_suffix(".part")
    np.zeros(16, np.int64).tofile(beside)
    beside.rename(path)  # there at once, and whole
    cell = _memory(path)
    _await(cell, 0, 0, 1)  # compiled
    while cell[15] == 0:
        time.sleep(0.05)
    realtime.claim(realtime.core(0))
    pacer = realtime.Pacer(1_000_000)
    took_ns = np.empty(pings)
    for number in range(pings):
        pacer.wait(number)
        sent_ns = time.perf_counter_ns()
        cell[0] = number + 1
        if not _await(cell, 8, number + 1, _LOOKS):
            raise RuntimeError("the other end does not answer")
        took_ns[number] = time.perf_counter_ns() - sent_ns
    return took_ns


def _echo_memory(path: str, pings: int) -> None:
    until_s = time.monotonic() + _START_S
    while not Path(path).exists() and time.monotonic() < until_s:
        time.sleep(0.05)
    cell = _memory(path)
    _answer(cell, 0, 1)  # compiled
    realtime.claim(realtime.core(1))
    cell[15] = 1
    _answer(cell, pings, _LOOKS)


if __name__ == "__main__":
    which, what, where, many, file = sys.argv[1:6]
    if which == "ping":
        _ping(what, where, int(many), file)
    else:
        _echo(what, where, int(many))
