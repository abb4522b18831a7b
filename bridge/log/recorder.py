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
from bridge.plain import StepReport, no_report
from bridge.wire import realtime
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.complaints import Complaints
from bridge.wire.pauses import PauseWatch
from bridge.wire.payloads import SCHEMA_VERSION, parsed, refuse_other_schema
from bridge.wire.topics import CONTROLLER_EVENT, PLANT_EVENT, RECORDER_EVENT, TOPICS
from bridge.wire.zenoh_link import Bus, BusConfig, Inbox

_INBOX_LIMIT = 1 << 16  # messages, 16 s of a run at 4100 messages/s; smaller: messages are lost while the disk is busy
_QUIET_S = 0.3  # silence after the last END that ends the recording: no message is still on its way
_PLANT_LOST_S = 1.0  # silence from which a plant that left the bus counts as lost
_GIVEN_UP_S = 30.0  # longest wait for a lost rig; the recording then ends
_LOOK_S = 0.05  # longest wait for a message; a stop and the end of a chunk are delayed by at most this
_STOP_S = 3.0  # longest recording after a stop; the plant fades out within 1 s, but a foreign rig may never end
# Switch interval of Python's threads while both have work; the default is 5 ms. After a slow disk the loop works off its backlog:
# with 5 ms the receiving thread takes only 200 of the 4100 messages per second, and the rig's link drops the others.
_SWITCH_S = 5e-5
# events that are also printed for the operator
_ALOUD = frozenset({"LOG_LOST", "LOG_REPLACED", "LOG_WRITE", "DISK_SLOW", "DROPPED"})


def run(
    path: Path,
    bus_config: BusConfig,
    roles: list[str],
    about: dict[str, object],
    lockstep: bool,
    stop: threading.Event,
    ready: Callable[[], None] = lambda: None,
    rotation: Rotation = NO_ROTATION,
    report: StepReport = no_report,
) -> None:
    """Record until the plant and the controller have ended, or `stop` is set.

    Args:
        path: the log.
        bus_config: the bus.
        roles: the processes whose configurations are awaited and written.
        about: further entries on the run, written as a table `run`.
        lockstep: log times are simulated times, and no message is dropped.
        stop: ends the recording.
        ready: called when the roles have answered, before the log is begun.
        rotation: when the log continues in a new file.
        report: reports the state of this process to the operator.

    Raises Fault NO_PEER, NOT_SECURE, PEER_DIED, BAD_MESSAGE for a header of an unknown schema version, LOG_WRITE, LOG_LOST. In
    real time the last two are raised at the end, as the run continues.

    """
    sys.setswitchinterval(_SWITCH_S)
    report("waiting", f"for a rig at {bus_config.endpoint}, at most {bus_config.wait_s:g} s")
    with Bus(bus_config, "recorder", lockstep, stop) as bus:
        inbox = Inbox(_INBOX_LIMIT, patient=lockstep)
        for topic in TOPICS:
            if topic.logged and topic.sender != "recorder":
                bus.listen(topic, inbox.push)
        report("waiting", f"for the headers of {' and '.join(roles)}, at most {bus_config.wait_s:g} s")
        headers = bus.headers(roles, bus_config.wait_s, stop)
        report("joined", " and ".join(headers) or "no process sent a header")
        for header in headers.values():
            refuse_other_schema(header)
        ready()
        bus.serve_header(wire.Header(role="recorder", schema_version=SCHEMA_VERSION))
        send = bus.publisher(RECORDER_EVENT)

        def on_event(event: wire.Event) -> None:
            send(event.SerializeToString())
            if event.code in _ALOUD:
                print(f"stickslip: warning: {event.code}: {event.text}", file=sys.stderr, flush=True)

        log = RunLog(path, lockstep, rotation, patient=not lockstep, on_event=on_event)
        log.add_metadata("run", about)
        for role in sorted(headers):
            log.add_header(headers[role])
        with contextlib.ExitStack() as ending:
            pauses = None
            if lockstep:  # without deadlines: the priority of plant and controller
                realtime.claim(realtime.core(bus_config.port + 1), realtime.LOCKSTEP_PRIORITY)
            else:
                realtime.claim(None, realtime.RECORDER_PRIORITY)
                watch = ending.enter_context(contextlib.closing(PauseWatch()))
                pauses = PauseWriter(log, watch)
            bus.announce()
            report("running", f"recording all messages into {path}")
            complaints = Complaints(log.add_event)
            lost_plant = _record(log, bus, inbox, stop, pauses, complaints)
            complaints.report_when_due(all_of_it=True)
            if pauses is not None:
                pauses.finish()
        log.close()
        report(
            "ended", "stopped" if stop.is_set() else "with the rig" if not lost_plant else "the rig left without an END"
        )
    if lost_plant:
        raise Fault(
            "PEER_DIED", f"the plant left the bus before its end; {path} was closed with every message received"
        )


def _record(
    log: RunLog, bus: Bus, inbox: Inbox, stop: threading.Event, pauses: PauseWriter | None, complaints: Complaints
) -> bool:
    """Write until plant and controller have ended. Returns whether the plant left the bus without an END."""
    screen = Screen(complaints)
    ended: set[str] = set()
    heard_s = time.monotonic()
    seen = lost = False
    dropped = 0
    until_s = math.inf
    while True:
        if stop.is_set():
            until_s = min(until_s, time.monotonic() + _STOP_S)
        if new := inbox.dropped - dropped:
            complaints.note("DROPPED", "inbox", "message lost: the recorder was too slow", new)
            dropped += new
        if time.monotonic() > until_s:
            return False
        asked_s = time.monotonic()
        received = inbox.get(_LOOK_S)
        passed = screen.passed(received) if received is not None else []
        if passed or realtime.was_paused(asked_s, asked_s + _LOOK_S):
            heard_s = time.monotonic()
        if passed:
            # a busy recorder may find no moment to look for the rig before it leaves
            seen = seen or any(message.topic.sender == "plant" for message in passed)
            for message in passed:
                try:
                    log.write(message.topic, message.payload)
                    if pauses is not None:
                        pauses.note(message)
                    if message.topic in {PLANT_EVENT, CONTROLLER_EVENT}:
                        event = parsed(wire.Event, message.payload, message.topic.name)
                        if event.code == "END":
                            ended.add(message.topic.sender)
                except Fault as fault:
                    if fault.kind.code != "BAD_MESSAGE":
                        raise
                    screen.unreadable(message, fault)  # a wrong message of one client must not end the recording
            complaints.report_when_due()
            continue
        log.flush_when_due()
        if pauses is not None:
            pauses.report_when_due()
        quiet_s = time.monotonic() - heard_s
        if stop.is_set() and quiet_s > _QUIET_S:
            return False
        complaints.report_when_due()
        present = bus.alive("plant")
        # an END is ignored while the rig is on the bus: it may be forged
        if "plant" in ended and not present and ("controller" in ended or quiet_s > _QUIET_S):
            return False
        seen = seen or present
        if present or not seen or quiet_s < _PLANT_LOST_S:
            lost = lost and not present
        elif not lost:
            lost = True
            why = "the plant left the bus before its end" if bus.linked() else "the link to the plant is down"
            log.add_event("PLANT_LOST", f"{why}; waiting for it for {_GIVEN_UP_S:g} s")
        if lost and (pauses is None or quiet_s > _GIVEN_UP_S):
            return True
