"""The recorder process: writes every message on the bus to one log."""

import contextlib
import math
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

from bridge.faults import Fault
from bridge.log.pause_writer import PauseWriter
from bridge.log.runlog import NO_ROTATION, Rotation, RunLog
from bridge.log.screen import Screen
from bridge.plain import Tell, untold
from bridge.wire import realtime
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.complaints import Complaints
from bridge.wire.pauses import PauseWatch
from bridge.wire.payloads import SCHEMA_VERSION, parsed, refuse_other_schema
from bridge.wire.topics import CONTROLLER_EVENT, PLANT_EVENT, RECORDER_EVENT, TOPICS
from bridge.wire.zenoh_link import Bus, BusConfig, Inbox

_INBOX_LIMIT = 1 << 16  # messages, 15 s of a run at 4100 messages/s; smaller loses messages while the disk is busy
_QUIET_S = 0.3  # silence after the last END from which no message is under way
_PLANT_LOST_S = 1.0  # silence from which a plant that left the bus counts as lost
_GIVEN_UP_S = 30.0  # without a rig the recording ends then
_LOOK_S = 0.05  # longest wait for a message; what a stop and the age of a chunk can be late by
_STOP_S = 3.0  # longest recording after a stop; the plant fades out within 1 s, and a rig may never end
# Between two turns of Python's threads while both have work; 5 ms by default. After a slow disk the loop works off what waits:
# with 5 ms the thread that receives takes 200 messages a second of the 4100 that come, and the rig's link drops the others.
_SWITCH_S = 5e-5
_TOLD_S = 1.0  # between two words about messages that did not fit into the inbox
_ALOUD = frozenset(
    {"LOG_LOST", "LOG_REPLACED", "LOG_WRITE", "DISK_SLOW", "DROPPED"}
)  # events that a person must see at once


def run(
    path: Path,
    bus_config: BusConfig,
    roles: list[str],
    about: dict[str, object],
    lockstep: bool,
    stop: threading.Event,
    ready: Callable[[], None] = lambda: None,
    rotation: Rotation = NO_ROTATION,
    say: Tell = untold,
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
        rotation: when the log goes on in a new file.
        say: tells of the life of this process, for a person.

    Raises Fault NO_PEER, NOT_SECURE, PEER_DIED, BAD_MESSAGE for a header of a schema version that is not known, LOG_WRITE,
    LOG_LOST; the last two at the end, in real time, as the run goes on meanwhile.

    """
    sys.setswitchinterval(_SWITCH_S)
    say("waiting", f"for a rig at {bus_config.endpoint}, at most {bus_config.wait_s:g} s")
    with Bus(bus_config, "recorder", lockstep, stop) as bus:
        inbox = Inbox(_INBOX_LIMIT, patient=lockstep)
        for topic in TOPICS:
            if topic.logged and topic.sender != "recorder":
                bus.listen(topic, inbox.push)
        say("waiting", f"for what {' and '.join(roles)} say of themselves, at most {bus_config.wait_s:g} s")
        headers = bus.headers(roles, bus_config.wait_s, stop)
        say("joined", " and ".join(headers) or "nobody said anything of itself")
        for header in headers.values():
            refuse_other_schema(header)
        ready()
        bus.serve_header(wire.Header(role="recorder", schema_version=SCHEMA_VERSION))
        send = bus.publisher(RECORDER_EVENT)

        def tell(event: wire.Event) -> None:
            send(event.SerializeToString())
            if event.code in _ALOUD:
                print(f"stickslip: warning: {event.code}: {event.text}", file=sys.stderr, flush=True)

        log = RunLog(path, lockstep, rotation, patient=not lockstep, on_event=tell)
        log.add_metadata("run", about)
        for role in sorted(headers):
            log.add_header(headers[role])
        with contextlib.ExitStack() as ending:
            pauses = None
            send = bus.publisher(RECORDER_EVENT)
            if lockstep:  # beside plant and controller
                realtime.claim(realtime.core(bus_config.port + 1), realtime.LOCKSTEP_PRIORITY)
            else:
                realtime.claim(None, realtime.RECORDER_PRIORITY)
                watch = ending.enter_context(contextlib.closing(PauseWatch()))
                pauses = PauseWriter(log, watch)
            bus.announce()
            say("running", f"all that is said from now on goes into {path}")
            complaints = Complaints(log.add_event)
            lost_plant = _record(log, bus, inbox, stop, pauses, complaints)
            complaints.tell_when_due(all_of_it=True)
            if pauses is not None:
                pauses.finish()
        log.close()
        say(
            "ended", "stopped" if stop.is_set() else "with the rig" if not lost_plant else "the rig left without an END"
        )
    if lost_plant:
        raise Fault("PEER_DIED", f"the plant went away before its end; {path} was closed with all that came")


def _record(
    log: RunLog, bus: Bus, inbox: Inbox, stop: threading.Event, pauses: PauseWriter | None, complaints: Complaints
) -> bool:
    """Write until plant and controller have ended. Returns whether the plant left the bus without an END."""
    dropped = _Dropped(log, inbox)
    lost_plant = _until_the_end(log, bus, inbox, stop, pauses, dropped, complaints)
    dropped.tell(at_once=True)
    return lost_plant


def _until_the_end(
    log: RunLog,
    bus: Bus,
    inbox: Inbox,
    stop: threading.Event,
    pauses: PauseWriter | None,
    dropped: "_Dropped",
    complaints: Complaints,
) -> bool:
    screen = Screen(complaints)
    ended: set[str] = set()
    heard_s = time.monotonic()
    seen = lost = False
    until_s = math.inf
    while True:
        if stop.is_set():
            until_s = min(until_s, time.monotonic() + _STOP_S)
        dropped.tell()
        if time.monotonic() > until_s:
            return False
        asked_s = time.monotonic()
        received = inbox.get(_LOOK_S)
        passed = screen.passed(received) if received is not None else []
        if passed or realtime.was_paused(asked_s, asked_s + _LOOK_S):
            heard_s = time.monotonic()
        if passed:
            for one in passed:
                try:
                    log.write(one.topic, one.payload)
                    if pauses is not None:
                        pauses.note(one)
                    if one.topic in {PLANT_EVENT, CONTROLLER_EVENT}:
                        event = parsed(wire.Event, one.payload, one.topic.name)
                        if event.code == "END":
                            ended.add(one.topic.sender)
                except Fault as fault:
                    if fault.kind.code != "BAD_MESSAGE":
                        raise
                    screen.unreadable(one, fault)  # a wrong message of one client must not end the recording
            complaints.tell_when_due()
            continue
        log.flush_when_due()
        if pauses is not None:
            pauses.tell_when_due()
        quiet_s = time.monotonic() - heard_s
        if stop.is_set() and quiet_s > _QUIET_S:
            return False
        complaints.tell_when_due()
        there = bus.alive("plant")
        # an END of a rig that stays is a stranger's
        if "plant" in ended and not there and ("controller" in ended or quiet_s > _QUIET_S):
            return False
        seen = seen or there
        if there or not seen or quiet_s < _PLANT_LOST_S:
            lost = lost and not there
        elif not lost:
            lost = True
            why = "the plant left the bus before its end" if bus.linked() else "the link to the plant is down"
            log.add_event("PLANT_LOST", f"{why}; waiting for it for {_GIVEN_UP_S:g} s")
        if lost and (pauses is None or quiet_s > _GIVEN_UP_S):
            return True


class _Dropped:
    """Tells of messages that did not fit into the inbox, once a second at most."""

    def __init__(self, log: RunLog, inbox: Inbox) -> None:
        self._log, self._inbox = log, inbox
        self._told = 0
        self._due_s = 0.0

    def tell(self, at_once: bool = False) -> None:
        new = self._inbox.dropped - self._told
        if new and (at_once or time.monotonic() > self._due_s):
            self._due_s = time.monotonic() + _TOLD_S
            self._told += new
            self._log.add_event("DROPPED", f"{new} messages: the recorder was too slow")
