"""Publish a log on the bus at its recorded times: for viewers, or to feed a rig's record to a controller on the bench."""

import threading
import time
from pathlib import Path
from typing import Any

from bridge.faults import Fault
from bridge.log.logfile import RunData, read_run
from bridge.rig.process import wait_for_peers
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.topics import ANNOUNCE, APPLIED, COMMAND, PLANT_EVENT, SENSORS, STATE, TRACE, Topic
from bridge.wire.zenoh_link import Bus, BusConfig

_GOODBYE_S = 1.0  # longest wait at the end until the other processes have left the bus


def publish_log(
    path: Path,
    bus_config: BusConfig,
    speed: float,
    from_s: float,
    everything: bool,
    wait_for: list[str],
    stop: threading.Event,
) -> None:
    """Publish a log from `from_s` on in the role of the plant, at a multiple of real time, until its end or `stop`.

    With `everything` also the controller's topics, otherwise a live controller may answer. `wait_for`: roles that must be on the
    bus first. Raises Fault BAD_LOG, ENDPOINT_BUSY, NO_PEER.
    """
    run = read_run(path)
    tables = [(ANNOUNCE, run.announce), (SENSORS, run.sensors), (APPLIED, run.applied)]
    if everything:
        tables += [(COMMAND, run.command), (TRACE, run.trace), (STATE, run.state)]
    # lockstep: publishing waits for a slow receiver instead of dropping messages, as nothing is controlled
    with Bus(bus_config, "plant", lockstep=True) as bus:
        for role in ("plant", "controller") if everything else ("plant",):
            if role in run.headers:
                bus.serve_header(_header(run, role))
        send = {topic.name: bus.publisher(topic) for topic, _ in tables}
        send_event = bus.publisher(PLANT_EVENT)
        bus.announce()
        wait_for_peers(bus, bus_config, wait_for, stop)
        send_event(_event("START", f"replay of {path.name} at {speed:g} times real time"))
        blocks = _play(tables, send, round(from_s * 1e9), speed, stop)
        send_event(_event("END", f"blocks={blocks}"))
        bus.withdraw()
        bus.wait_until_alone(_GOODBYE_S)


def _play(
    tables: list[tuple[Topic, Any]], send: dict[str, Any], from_ns: int, speed: float, stop: threading.Event
) -> int:
    """Send each message from `from_ns` on when it is due, until the end or `stop`; return the number of blocks sent."""
    schedule = sorted(  # within a block in the order of the tables
        (t_ns, place, row)
        for place, (_, table) in enumerate(tables)
        for row, t_ns in enumerate(table["t_ns"].tolist())
        if t_ns >= from_ns
    )
    blocks, began_s = 0, time.perf_counter()
    for t_ns, place, row in schedule:
        due_s = began_s + (t_ns - schedule[0][0]) * 1e-9 / speed
        if stop.wait(max(due_s - time.perf_counter(), 0.0)):
            break
        topic, table = tables[place]
        send[topic.name](table[row : row + 1].tobytes())
        blocks += topic is SENSORS
    return blocks


def _header(run: RunData, role: str) -> wire.Header:
    fields = run.headers[role]
    try:
        return wire.Header(
            role=role,
            schema_version=int(fields["schema_version"]),
            configuration=fields["configuration"],
            versions=fields["versions"],
        )
    except (KeyError, ValueError):
        line = f"{run.path}: the header of the {role} lacks schema_version, configuration or versions"
        raise Fault("BAD_LOG", f"{line}; take another copy of the log") from None


def _event(code: str, text: str) -> bytes:
    sequence = 0 if code == "START" else 1
    return wire.Event(sequence=sequence, source="plant", code=code, text=text).SerializeToString()
