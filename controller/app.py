"""The controller process: blocks in, commands out. The command leaves first; all other messages follow."""

import json
import math
import threading
from collections.abc import Generator

from bridge.faults import Fault
from bridge.plain import StepReport, no_report
from bridge.wire import realtime
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.clock import Wait, carry_out, time
from bridge.wire.complaints import BAD_MESSAGE, FLOOD, FOREIGN, Complaints
from bridge.wire.event_codes import is_listed
from bridge.wire.inbox import WAITING
from bridge.wire.payloads import other_rig, parsed
from bridge.wire.session import LEASE_S
from bridge.wire.topics import (
    ANNOUNCE,
    COMMAND,
    CONTROLLER_EVENT,
    OPERATOR,
    PLANT_EVENT,
    SENSORS,
    SNAPSHOT,
    STATE,
    TRACE,
)
from bridge.wire.zenoh_link import Bus, BusConfig, Inbox, Received
from controller.config import ControllerConfig
from controller.freshness import Events, Freshness
from controller.node import ControllerNode
from controller.rig_header import clock_drift, for_rig, refuse_another_rig

# Longest wait for another process: for the token and the header of a rig, each of which a rig without it delays by all of it; for
# blocks of a rig that has left the bus, until it counts as lost; and for the recorder after a cut of the link. The recorder was
# back 0.4 s after this process (tests/system/test_restart.py). Shorter: events miss the log. Longer: a rig is lost later.
_WAIT_S = 1.0
_GIVEN_UP_S = 30.0  # time without a rig after which this process ends; equals the wait for a rig at the start
_AT_ONCE_S = 0.05  # time for a controller that starts at the same moment to appear, and period of checking again
# Wait for another controller to leave. Shorter: a frozen controller refuses this one, though its lease is about to end. Longer: a
# second controller is refused later.
_OTHER_GONE_S = LEASE_S + 0.2


def run(
    config: ControllerConfig,
    bus_config: BusConfig,
    header: wire.Header,
    lockstep: bool,
    stop: threading.Event,
    report: StepReport = no_report,
) -> int:
    """Answer every block on the bus until the plant ends its run or `stop` is set; return the number of steps.

    `report`: reports start, waiting and end of this process to the operator.

    Raises Fault NO_PEER, PEER_DIED, BAD_MESSAGE, CONFIG, ENDPOINT_BUSY.
    """
    node = ControllerNode(config)
    node.warm_up()
    report("waiting", f"for a rig at {bus_config.endpoint}, at most {bus_config.wait_s:g} s")
    with Bus(bus_config, "controller", lockstep, stop) as bus:
        _refuse_a_second(bus, bus_config.endpoint)
        of_rig = bus.headers(["plant"], _WAIT_S, stop).get("plant")
        config = for_rig(of_rig, config)
        node.age.drift = clock_drift(of_rig)
        node.reconfigure(config)
        header.configuration = json.dumps(config.model_dump(mode="json"), sort_keys=True)  # a replay needs them
        bus.serve_header(header)
        process = ControllerProcess(config, node, bus, lockstep, report=report)
        granted = ""
        if lockstep:
            # Plant and controller take turns: if they share a core, waking the other process takes a tenth of the time.
            # Parallel runs have other ports and so other cores.
            realtime.claim(realtime.core(bus_config.port), realtime.LOCKSTEP_PRIORITY)
        else:
            granted = realtime.claim(realtime.core(1))  # before the announcement, as the rig may begin right after
        bus.announce()
        report("joined", f"the rig at {bus_config.endpoint}; waiting for its first block")
        if of_rig is not None and (text := other_rig(of_rig.rig, header.rig)):
            report("warning", text)
        process.realtime(stop, granted)
    report("ended", "stopped" if stop.is_set() else "with the rig")
    return node.steps


def _refuse_a_second(bus: Bus, endpoint: str) -> None:
    """Raise Fault ENDPOINT_BUSY where another controller is on the bus.

    Two controllers would command different amplitudes to one piezo in turn. Two controllers that start at the same time see
    each other's claims: the controller with the higher claim ends.
    """
    mine, others = bus.claim()
    bus.wait_for(["plant"], _WAIT_S)  # by then all others are known, except a controller that starts now
    time.sleep(_AT_ONCE_S)
    since_s = time.monotonic()
    while (rivals := others()) or bus.alive("controller"):
        time.sleep(_AT_ONCE_S)
        patience_s = _OTHER_GONE_S if any(rival < mine for rival in rivals) else 2.0 * _OTHER_GONE_S
        if time.monotonic() > since_s + patience_s:
            line = f"{endpoint}: another controller is on this bus: must be one"
            raise Fault("ENDPOINT_BUSY", f"{line}; end it, or choose another --endpoint or --prefix")


class ControllerProcess:
    """The loop of a controller on a bus.

    Args:
        config, node: the controller.
        bus: the controller's session.
        lockstep: whether the rig waits for the command of each block.
        report: reports start, waiting and end of this process, and its important events, to the operator.

    """

    def __init__(
        self,
        config: ControllerConfig,
        node: ControllerNode,
        bus: Bus,
        lockstep: bool,
        report: StepReport = no_report,
    ) -> None:
        self._report = report
        self._config = config
        self._node = node
        self._bus = bus
        self._lockstep = lockstep
        self._inbox = Inbox(WAITING)
        self._events = 0
        self._waiting: list[bytes] = []  # events that are not sent yet
        self._events_from_s = 0.0  # time from which events are sent: during a cut of the link the log would miss them
        self._complaints = Complaints(self.event)
        node.note = self._complaints.note
        self._dropped: dict[str, int] = {}  # number of published drops of the inbox, by topic
        self._end_sent_s: float | None = None
        self._refusal: Fault | None = None  # of a restarted rig, by its header
        self._rig_came = 0
        self._rig_lost = ""  # the reason, from RIG_LOST until blocks arrive
        self._blocks = Freshness(config.block_s, config.limits.stale_after_s)
        self._send = {topic.name: bus.publisher(topic) for topic in (COMMAND, TRACE, STATE, SNAPSHOT, CONTROLLER_EVENT)}
        bus.listen(SENSORS, self._inbox.push)
        for topic in (ANNOUNCE, PLANT_EVENT, OPERATOR):
            bus.listen(topic, self._inbox.keep)

    def event(self, code: str, text: str) -> None:
        """Publish an event with a code and a text."""
        event = wire.Event(sequence=self._events, t_ns=self._node.t_ns, source="controller", code=code, text=text)
        self._events += 1
        self._waiting.append(event.SerializeToString())
        self._send_events()
        if is_listed(code):
            self._report(code, text)

    def _send_events(self) -> None:
        while self._waiting and time.monotonic() >= self._events_from_s:
            self._send[CONTROLLER_EVENT.name](self._waiting.pop(0))

    def realtime(self, stop: threading.Event, granted: str) -> None:
        """Answer blocks by the computer's clock, as `loop` does."""
        carry_out(self.loop(stop, granted))

    def loop(self, stop: threading.Event, granted: str) -> Generator[Wait]:
        """Take blocks in order and answer each block; the plant applies the newest answer.

        `granted`: the priority of this process, published when the run begins.
        """
        try:
            yield from self._answer(stop, granted)
        finally:
            yield from self._fade_out()
            self._publish(self._blocks.paused())
            self._complaints.report_when_due(all_of_it=True)
        node = self._node
        self._events_from_s = 0.0
        self.event("END", f"steps={node.steps} duplicates={node.duplicates} dropped={self._inbox.dropped}")

    @property
    def _ended(self) -> bool:
        """Whether the rig sent END and left the bus. END alone may be forged, so it is ignored while the rig stays."""
        return self._end_sent_s is not None and not self._bus.alive("plant")

    def _answer(self, stop: threading.Event, granted: str) -> Generator[Wait]:
        self._rig_came = self._bus.came("plant")
        blocks = self._blocks
        blocks.heard(time.monotonic())
        started = False
        while not stop.is_set() and not self._ended:
            asked_s = time.monotonic()
            received = yield from self._inbox.next(max(blocks.due_s - asked_s, 0.0))
            waited_until_s = max(asked_s, blocks.due_s)
            if received is not None:
                self._consume(received)
                if received.topic is SENSORS and not started:
                    started = True
                    self._report("running", granted or "in lockstep")
                    if not self._lockstep:
                        # only now: the plant sends its first block once the recorder listens, so the log holds this event
                        self.event("START", granted)
                self._report_drops()
                if self._refusal is not None:
                    raise self._refusal
            if realtime.was_paused(waited_until_s, waited_until_s):
                blocks.heard_s = time.monotonic()
                if not self._lockstep:
                    blocks.stalled(blocks.heard_s - waited_until_s)
            # a rig that has left sends no block, so checking when a block is missing is enough
            if time.monotonic() < blocks.due_s or self._ended:
                continue
            self._check_rig(blocks.heard_s)
            if started and not self._lockstep:
                silent_blocks, events = blocks.missing(time.monotonic())
                self._publish(events)
                self._ramp(silent_blocks)
            else:
                blocks.due_s = time.monotonic() + self._config.limits.stale_after_s

    def _publish(self, events: Events) -> None:
        for code, text in events:
            self.event(code, text)

    def _report_drops(self) -> None:
        """Report messages that the inbox dropped, and faults that have waited for a second."""
        for topic, dropped in list(self._inbox.dropped_of.items()):
            if new := dropped - self._dropped.get(topic, 0):
                self._dropped[topic] = dropped
                self._complaints.note(FLOOD, topic, "more messages than can be answered: dropped", new)
        self._complaints.report_when_due()

    def _ramp(self, silent_blocks: int) -> None:
        self._send[COMMAND.name](self._node.stale(silent_blocks).payload)
        self._send_rest(0)

    def _fade_out(self) -> Generator[Wait]:
        """Ramp to zero before this process ends for any reason, as not every rig ends its last command by itself."""
        while self._node.amplitude_m > 0.0 and not (self._lockstep or self._ended):
            self._ramp(1)
            yield from time.wait(self._config.block_s)

    def _consume(self, received: Received) -> None:
        """Take one message. Unreadable messages are dropped and reported."""
        try:
            if received.topic is SENSORS:
                self._take_block(received)
            elif received.topic is ANNOUNCE:
                self._node.announcement(received.payload)
            elif received.topic is OPERATOR:
                self._apply(received.payload)
            else:
                self._take_rig_event(parsed(wire.Event, received.payload, PLANT_EVENT.name))
        except Fault as fault:
            if fault.kind.code != "BAD_MESSAGE":
                raise
            self._complaints.note(BAD_MESSAGE, received.topic.name, f"{fault.line.partition(': ')[2]}: dropped")

    def _take_block(self, received: Received) -> None:
        """Answer a new block, then publish its events; only a new block is fresh: a rig that hangs may repeat its last block."""
        node, in_real_time = self._node, not self._lockstep
        command = node.block(received.payload, received.arrival_ns, time.perf_counter_ns() if in_real_time else 0)
        if command is None:
            return
        self._send[COMMAND.name](command.payload)
        if in_real_time:
            realtime.let_the_bus_send()
        self._send_rest(received.arrival_ns if in_real_time else 0)
        now_s = time.monotonic()
        for code, text in node.news():
            self.event(code, text)
            if code == "RIG_RESTARTED":
                threading.Thread(target=self._read_header_again, name="rig again", daemon=True).start()
        if self._rig_lost:  # the event repeats the reason, as RIG_LOST may not have passed the broken link
            self._report("joined", "the rig again")
            self._events_from_s = min(self._events_from_s, now_s + _WAIT_S)
            self.event("RIG_BACK", f"blocks arrive again, from block {node.last_block} on; {self._rig_lost}")
            self._rig_lost = ""
        if self._waiting:
            self._events_from_s = 0.0 if self._bus.alive("recorder") else self._events_from_s
            self._send_events()
        if self._end_sent_s is not None and now_s - self._end_sent_s > _WAIT_S:
            self._end_sent_s = None
            self._complaints.note(FOREIGN, PLANT_EVENT.name, "END, but the rig still runs: ignored")
        self._publish(self._blocks.heard(now_s, node.in_time))

    def _read_header_again(self) -> None:
        """Compare the header of a restarted rig, in a thread, as the loop must not wait for it."""
        try:
            refuse_another_rig(self._bus.headers(["plant"], _WAIT_S, threading.Event()).get("plant"), self._config)
        except Fault as fault:
            self._refusal = fault

    def _take_rig_event(self, event: wire.Event) -> None:
        if event.code == "END":
            self._end_sent_s = time.monotonic()
        elif event.code == "START" and self._lockstep and event.text != "lockstep":
            line = f"{PLANT_EVENT.name}: START {event.text!r}: must be 'lockstep', as a controller --lockstep waits"
            raise Fault("CONFIG", f"{line} for ever if blocks stop; remove --lockstep, or give it to the rig too")

    def _apply(self, payload: bytes) -> None:
        """Apply an operator's command, and report it if the rig does not. Raises Fault BAD_MESSAGE."""
        command = parsed(wire.Operator, payload, OPERATOR.name)
        if command.action not in wire.Operator.Action.values():
            raise Fault("BAD_MESSAGE", f"{OPERATOR.name}: action = {command.action}: not known")
        self._node.operator(command.action)
        if not (self._node.rig_reports and self._blocks.is_fresh):  # a rig with a guard reports the command itself
            self._complaints.order(wire.Operator.Action.Name(command.action), command.who)

    def _send_rest(self, arrival_ns: int) -> None:
        lateness_ns = time.perf_counter_ns() - arrival_ns if arrival_ns else 0
        for message in self._node.rest(lateness_ns):
            self._send[message.topic.name](message.payload)

    def _check_rig(self, heard_s: float) -> None:
        """Report a rig that left, and end after half a minute without it; called while blocks are missing."""
        if self._bus.came("plant") != self._rig_came:
            self._rig_came = self._bus.came("plant")
            self._node.rig_was_away()
        silent_s = time.monotonic() - heard_s
        if silent_s < _WAIT_S or self._bus.alive("plant"):
            return
        why = "the rig left the bus" if self._bus.linked() else "the link to the rig is down"
        text = f"{why}; last block at {self._node.block_t_ns * 1e-9:.3f} s"
        if self._lockstep or silent_s > _GIVEN_UP_S:
            raise Fault("PEER_DIED", f"{text}, {silent_s:.1f} s ago")
        if not self._rig_lost:
            self._rig_lost, self._events_from_s = f"{text} then", 0.0 if self._bus.linked() else math.inf
            self._report("waiting", f"for the rig, at most {_GIVEN_UP_S:g} s: {text}")
            self.event("RIG_LOST", f"{text}; waiting for it for {_GIVEN_UP_S:g} s")
