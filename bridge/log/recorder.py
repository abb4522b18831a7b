"""The recorder process: writes every message on the bus to one log."""

import contextlib
import math
import threading
import time
from collections.abc import Callable
from pathlib import Path

from bridge.faults import Fault
from bridge.log.pause_writer import PauseWriter
from bridge.log.runlog import RunLog
from bridge.wire import realtime
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.pauses import PauseWatch
from bridge.wire.payloads import parsed
from bridge.wire.topics import RECORDER_EVENT, TOPICS
from bridge.wire.zenoh_link import Bus, BusConfig, Inbox

_INBOX_LIMIT = 1 << 16  # messages, 15 s of a run at 4100 messages/s; smaller loses messages while the disk is busy
_HEADERS_WAIT_S = 30.0  # time for the roles to answer; a first start compiles kernels
_QUIET_S = 0.3  # silence after the last END from which no message is under way
_PLANT_LOST_S = 1.0  # silence from which a plant that left the bus counts as lost
_LOOK_S = 0.05  # longest wait for a message; what a stop and the age of a chunk can be late by
_STOP_S = 3.0  # longest recording after a stop; the plant fades out within 1 s, and a rig may never end


def run(
    path: Path,
    bus_config: BusConfig,
    roles: list[str],
    about: dict[str, object],
    lockstep: bool,
    stop: threading.Event,
    ready: Callable[[], None] = lambda: None,
) -> None:
    """Record until the plant and the controller have ended, or `stop` is set.

    Args:
        path: the log.
        bus_config: of the bus.
        roles: the processes whose configurations are awaited and written.
        about: further entries on the run, written as a table `run`.
        lockstep: log times are simulated times, and no message is dropped.
        stop: ends the recording.
        ready: called when the roles have answered, before the log is begun.

    Raises Fault NO_PEER, PEER_DIED, LOG_WRITE.

    """
    with Bus(bus_config, "recorder", lockstep, stop) as bus:
        inbox = Inbox(_INBOX_LIMIT, patient=lockstep)
        for topic in TOPICS:
            if topic.logged and topic.sender != "recorder":
                bus.listen(topic, inbox.push)
        headers = bus.headers(roles, _HEADERS_WAIT_S, stop)
        ready()
        log = RunLog(path, lockstep)
        log.add_metadata("run", about)
        for role in sorted(headers):
            log.add_header(headers[role])
        with contextlib.ExitStack() as ending:
            pauses = None
            if lockstep:  # beside plant and controller
                realtime.claim(realtime.core(bus_config.port + 1), realtime.LOCKSTEP_PRIORITY)
            else:
                realtime.claim(None, realtime.RECORDER_PRIORITY)
                watch = ending.enter_context(contextlib.closing(PauseWatch()))
                pauses = PauseWriter(log, bus.publisher(RECORDER_EVENT), watch)
            bus.announce()
            lost_plant = _record(log, bus, inbox, stop, pauses)
            if pauses is not None:
                pauses.finish()
        if inbox.dropped:
            log.add_event("DROPPED", f"{inbox.dropped} messages: the recorder was too slow")
        log.close()
    if lost_plant:
        raise Fault("PEER_DIED", f"the plant left the bus before its end; {path} was closed with all that came")


def _record(log: RunLog, bus: Bus, inbox: Inbox, stop: threading.Event, pauses: PauseWriter | None) -> bool:
    """Write until plant and controller have ended. Returns whether the plant left the bus without an END."""
    ended: set[str] = set()
    heard_s = time.monotonic()
    seen = False
    until_s = math.inf
    while True:
        if stop.is_set():
            until_s = min(until_s, time.monotonic() + _STOP_S)
        if time.monotonic() > until_s:
            return False
        asked_s = time.monotonic()
        received = inbox.get(_LOOK_S)
        if received is not None or realtime.was_paused(asked_s, asked_s + _LOOK_S):
            heard_s = time.monotonic()
        if received is not None:
            try:
                log.write(received.topic, received.payload)
                if pauses is not None:
                    pauses.note(received)
                if received.topic.name.startswith("event/"):
                    event = parsed(wire.Event, received.payload, received.topic.name)
                    if event.code == "END":
                        ended.add(event.source)
            except Fault as fault:
                if fault.kind.code != "BAD_MESSAGE":
                    raise
                log.add_event("BAD_MESSAGE", fault.line)  # a wrong message of one client must not end the recording
            continue
        log.flush_when_due()
        if pauses is not None:
            pauses.tell_when_due()
        quiet_s = time.monotonic() - heard_s
        if stop.is_set() and quiet_s > _QUIET_S:
            return False
        if "plant" in ended and ("controller" in ended or quiet_s > _QUIET_S):
            return False
        seen = seen or bus.alive("plant")
        if seen and quiet_s > _PLANT_LOST_S and not bus.alive("plant"):
            log.add_event("PLANT_LOST", "the plant left the bus before its end")
            return True
