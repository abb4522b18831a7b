"""The controller process: blocks in, commands out. The command leaves first; all other messages follow."""

import threading
import time
from collections.abc import Callable

from bridge.faults import Fault
from bridge.wire import realtime
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.payloads import parsed
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
from controller.node import ControllerNode

# Blocks that may wait for the controller. Too small: a short pause loses blocks. Larger: commands answer older blocks.
# A step with its messages takes 0.04 ms (median of Trace.lateness_ns), so 256 blocks are answered within 11 ms.
_INBOX_LIMIT = 256
_PLANT_LOST_S = 1.0  # silence after which a plant that has left the bus counts as lost
_TOLD_S = 1.0  # longest wait for a plant at the start; a rig without a liveliness token costs all of it
_AT_ONCE_S = 0.05  # time for a second controller of the same moment to appear, and the period of looking again
_UNSEEN = "is its transducer at the end of its range, or loose? without v_d nothing is vibrated"
# Wait for another controller to leave. Too small: one that was killed, and whose lease of 0.1 s lasts, still refuses this one.
_OTHER_GONE_S = 0.5


def run(
    config: ControllerConfig,
    bus_config: BusConfig,
    header: wire.Header,
    lockstep: bool,
    stop: threading.Event,
) -> int:
    """Answer every block on the bus until the plant ends its run or `stop` is set; how many steps.

    Raises Fault NO_PEER, PEER_DIED, BAD_MESSAGE, CONFIG, ENDPOINT_BUSY.
    """
    node = ControllerNode(config)
    node.warm_up()
    with Bus(bus_config, "controller", lockstep, stop) as bus:
        bus.serve_header(header)
        process = _Process(config, node, bus, lockstep)
        process.prepare()
        _refuse_a_second(bus, bus_config.endpoint)
        granted = ""
        if lockstep:
            # Plant and controller take turns: on one core waking the other process takes a tenth of the time. Runs at the
            # same time have other ports and so other cores.
            realtime.claim(realtime.core(bus_config.port), realtime.LOCKSTEP_PRIORITY)
        else:
            granted = realtime.claim(realtime.core(1))  # before the announcement, as the rig may begin right after
        bus.announce()
        process.loop(stop, granted)
    return node.steps


def _refuse_a_second(bus: Bus, endpoint: str) -> None:
    """Raise Fault ENDPOINT_BUSY where another controller is on the bus.

    Two controllers would pull one piezo to and fro, each inside its own slew limit. Two controllers that start at the same
    time see each other's claims: the controller with the higher claim yields.
    """
    mine, others = bus.claim()
    bus.wait_for(["plant"], _TOLD_S)  # by then the bus has told of all others, apart from those of the same moment
    time.sleep(_AT_ONCE_S)
    since_s = time.monotonic()
    while (rivals := others()) or bus.alive("controller"):
        time.sleep(_AT_ONCE_S)
        patience_s = _OTHER_GONE_S if any(rival < mine for rival in rivals) else 2.0 * _OTHER_GONE_S
        if time.monotonic() > since_s + patience_s:
            line = f"{endpoint}: another controller is on this bus: must be one"
            raise Fault("ENDPOINT_BUSY", f"{line}; end that one, or choose another --endpoint or --prefix")


class _Process:
    def __init__(self, config: ControllerConfig, node: ControllerNode, bus: Bus, lockstep: bool) -> None:
        self._node = node
        self._bus = bus
        self._lockstep = lockstep
        self._block_s = config.block_s
        self._stale_after_s = config.limits.stale_after_s
        self._inbox = Inbox(_INBOX_LIMIT)
        self._send: dict[str, Callable[[bytes], None]] = {}
        self._events = 0
        self._ended = False
        self._unreadable = False

    def prepare(self) -> None:
        """Open the publishers and listen to plant and operator."""
        for topic in (COMMAND, TRACE, STATE, SNAPSHOT, CONTROLLER_EVENT):
            self._send[topic.name] = self._bus.publisher(topic)
        self._bus.listen(SENSORS, self._inbox.push)
        self._bus.listen(ANNOUNCE, self._inbox.keep)
        for topic in (PLANT_EVENT, OPERATOR):
            self._bus.listen(topic, self._inbox.keep)

    def event(self, code: str, text: str) -> None:
        """Publish an event with a code and a text."""
        event = wire.Event(sequence=self._events, t_ns=self._node.t_ns, source="controller", code=code, text=text)
        self._events += 1
        self._send[CONTROLLER_EVENT.name](event.SerializeToString())

    def loop(self, stop: threading.Event, granted: str) -> None:
        """Consume blocks in order and answer each block; the plant applies the newest answer that it has.

        `granted`: the priority of this process, published when the run begins.
        """
        try:
            self._answer(stop, granted)
        finally:
            self._fade_out()
        node = self._node
        self.event("END", f"steps={node.steps} duplicates={node.duplicates} dropped={self._inbox.dropped}")

    def _answer(self, stop: threading.Event, granted: str) -> None:
        heard_s = time.monotonic()
        due_s = heard_s + self._stale_after_s  # the command ramps down then, unless a new block comes
        started = False
        stale = False
        while not stop.is_set() and not self._ended:
            asked_s = time.monotonic()
            received = self._inbox.get(max(due_s - asked_s, 0.0))
            if received is not None or realtime.was_paused(asked_s, due_s):
                heard_s = time.monotonic()
            if received is not None:
                if self._consume(received):  # only a new block is fresh: a rig that hangs may repeat its last block
                    due_s = heard_s + self._stale_after_s
                    if stale:
                        self.event("FRESH", "blocks arrive again")
                        stale = False
                if received.topic is SENSORS and not started:
                    started = True
                    if not self._lockstep:
                        # now, as the plant sends its first block only when the recorder listens
                        self.event("START", granted)
            if time.monotonic() < due_s:
                continue
            self._mind_the_plant(heard_s)
            if started and not self._lockstep:
                silent_blocks = 1 if stale else round(self._stale_after_s / self._block_s)
                if not stale:
                    self.event("STALE", f"no block for {self._stale_after_s * 1e3:g} ms: ramping to zero")
                stale = True
                self._ramp(silent_blocks)
            # The slew limit counts a step: once stale, one step a block period ramps as fast as with blocks.
            due_s = time.monotonic() + (self._block_s if stale else self._stale_after_s)

    def _ramp(self, silent_blocks: int) -> None:
        self._send[COMMAND.name](self._node.stale(silent_blocks).payload)
        self._send_rest(0)

    def _fade_out(self) -> None:
        """Ramp to zero before leaving, for any reason: not every rig ends its last command by itself."""
        while self._node.amplitude_m > 0.0 and not (self._lockstep or self._ended):
            self._ramp(1)
            time.sleep(self._block_s)

    def _consume(self, received: Received) -> bool:
        """Take one message; return whether it was a block that got an answer."""
        node = self._node
        if received.topic is SENSORS:
            command = node.block(received.payload)
            if command is not None:
                self._send[COMMAND.name](command.payload)
                self._send_rest(0 if self._lockstep else received.arrival_ns)
                self._tell_unreadable()
                if node.slipped_unmoved:
                    self.event(
                        "DRIVE_UNSEEN", f"block {node.last_block}: a slip, while the drive position stands: {_UNSEEN}"
                    )
            return command is not None
        if received.topic is ANNOUNCE:
            node.announcement(received.payload)
        elif received.topic is OPERATOR:
            self._obey(received.payload)
        else:
            self._mind(parsed(wire.Event, received.payload, PLANT_EVENT.name))
        return False

    def _mind(self, event: wire.Event) -> None:
        if event.code == "END":
            self._ended = True
        elif event.code == "START" and self._lockstep and event.text != "lockstep":
            line = f"{PLANT_EVENT.name}: START says {event.text!r}: must say 'lockstep' to a controller --lockstep, which waits"
            raise Fault(
                "CONFIG", f"{line} for ever where blocks stop coming; leave --lockstep away, or give it to the rig too"
            )

    def _tell_unreadable(self) -> None:
        if self._node.unreadable == self._unreadable:
            return
        self._unreadable = self._node.unreadable
        if self._unreadable:
            self.event("NOT_FINITE", f"block {self._node.last_block} holds a sample that is no number: ramping to zero")
        else:
            self.event("FRESH", "every sample is a number again")

    def _obey(self, payload: bytes) -> None:
        """Take an operator's message; an unreadable message must not stop the control, so it is ignored and told."""
        try:
            word = parsed(wire.Operator, payload, OPERATOR.name)
            name = wire.Operator.Action.Name(word.action)
        except (Fault, ValueError) as error:
            self.event("OPERATOR", f"ignored: {error}")
            return
        self._node.operator(word.action)
        self.event("OPERATOR", f"{name} by {word.who or 'somebody'}")

    def _send_rest(self, arrival_ns: int) -> None:
        lateness_ns = time.perf_counter_ns() - arrival_ns if arrival_ns else 0
        for message in self._node.rest(lateness_ns):
            self._send[message.topic.name](message.payload)

    def _mind_the_plant(self, heard_s: float) -> None:
        silent_s = time.monotonic() - heard_s
        if silent_s > _PLANT_LOST_S and not self._bus.alive("plant"):
            raise Fault("PEER_DIED", f"the plant left the bus; last block at {self._node.t_ns * 1e-9:.3f} s")
