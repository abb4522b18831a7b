"""The process of a rig: a guarded rig on the bus, paced by a clock or by the rig, or in lockstep with the controller."""

import collections
import contextlib
import secrets
import threading
from collections.abc import Callable, Generator, Sequence
from functools import partial

from bridge.faults import Fault
from bridge.guard.events import GuardEvents
from bridge.guard.keeper import Keeper
from bridge.guard.kept import KeptGain, KeptHeat, StateFile, StopLatch
from bridge.guard.received import CommandQueue
from bridge.guard.states import HOLD, RESET, STOP
from bridge.guard.stop_file import RigFile
from bridge.plain import StepReport, no_report
from bridge.rig.faults.line import Message
from bridge.rig.node import LATE_NS, GuardedNode, Served
from bridge.wire import realtime, refusals
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.clock import Wait, carry_out, time
from bridge.wire.complaints import BAD_MESSAGE, FOREIGN, Complaints
from bridge.wire.event_codes import is_listed
from bridge.wire.inbox import WAITING
from bridge.wire.payloads import parsed
from bridge.wire.topics import ANNOUNCE, APPLIED, COMMAND, FAULT, OPERATOR, PLANT_EVENT, SENSORS, Outgoing
from bridge.wire.zenoh_link import Bus, BusConfig, Inbox, Received

_ANSWER_TIMEOUT_S = 5.0  # lockstep: longest wait for the command that answers a block
_GOODBYE_S = 3.0  # longest wait of the ended plant for the other processes to leave the bus
_ROUND_TRIPS_KEPT = 1024  # blocks whose time of sending is kept; answers to older blocks have no round trip
_LONGEST_FADE_BLOCKS = 1000  # longest wait until the exciter rests [blocks]
# Longest wait for the answer to a block of a device, in block lengths. Smaller: a command of a busy computer acts a block later.
# Larger: the next block is read late.
_ANSWER_SHARE = 0.5
# Change of the exciter's warmth, over the largest allowed, after which it is stored. Smaller: more writes; with 0.05 there are 20
# on the way to the limit, and 20 as it cools. Larger: a crash forgets more.
_HEAT_STEP = 0.05
_REMIND_NS = 86_400_000_000_000  # interval of the events about certificates that expire: a day
_PAUSE_NS = 250_000_000  # delay of a due block from which this process counts as stalled


def serve(
    rig: Served,
    duration_s: float,
    bus_config: BusConfig,
    header: wire.Header,
    wait_for: list[str],
    lockstep: bool,
    stop: threading.Event,
    latch: StopLatch | None,
    report: StepReport = no_report,
) -> int:
    """Serve a rig on the bus until `duration_s` is over (0: for ever) or `stop` is set. Returns the number of blocks.

    Args:
        rig: the rig.
        latch: the operator's stop; in `stickslip run` it ends with the process; None in lockstep: no stop by file.
        report: reports the state of this process and important events to the operator.

    Raises Fault CONFIG for the name of another running rig, ENDPOINT_BUSY, NO_PEER, NOT_SECURE, PEER_DIED, LOCKSTEP_STALLED, and
    the faults of `make`.

    """
    outlasts = latch is not None and latch.outlasts
    keeper = None if latch is None else Keeper(latch, RigFile(latch.rig, bus_config.endpoint))
    latch_problem = latch.can_be_set() if latch is not None and outlasts else ""
    if keeper is not None and outlasts and (other := keeper.rig.namesake):
        line = f"rig.name = {rig.name!r}: a rig of this name runs at {other}: a stop or reset of either would hold for both"
        raise Fault("CONFIG", f"{line}; give this rig another name (--set rig.name=WORD), or end the other")
    run_number = 1 if lockstep else secrets.randbits(63) | 1  # in lockstep the same run gives the same log
    node = rig.make(run_number, not latch_problem)
    kept = KeptGain(rig.name, node.check_tones_Hz, rig.guard.exciter_gain) if outlasts else None
    warmth = KeptHeat(rig.name, rig.guard.heat.time_s) if outlasts else None
    if kept is not None:
        node.accept_gain(kept.load())
    if warmth is not None:
        node.warm(warmth.load())
    node.warm_up()
    block_s = node.block_ns * 1e-9
    blocks = round(duration_s / block_s) if duration_s > 0 else 2**62
    log = None if lockstep else refusals.captured()
    with Bus(bus_config, "plant", lockstep) as bus, contextlib.ExitStack() as ending:
        ending.callback(node.close)
        bus.serve_header(header)
        process = GuardedRig(node, bus, keeper, report, kept, warmth)
        begun = threading.Event()
        if log is not None:
            ending.enter_context(refusals.reported(log, partial(process.event, "REFUSED"), begun))
        if keeper is not None:  # before the wait for the other processes: a stop during it holds
            ending.enter_context(keeper.running(run_number, partial(process.event, "STATE_FOLDER")))
        # Priority is claimed before the other processes see this one: later, links may lapse on busy cores (docs/method/rig.md).
        if lockstep:
            realtime.claim(realtime.core(bus_config.port), realtime.LOCKSTEP_PRIORITY)
            granted = "lockstep"  # a text without the computer's settings: the same run gives the same log
        else:
            granted = realtime.claim(realtime.core(0))
        bus.announce()
        if wait_for and bus.wait_for(wait_for, 0.0):
            report("waiting", f"for {' and '.join(wait_for)} at {bus_config.endpoint}, at most {bus_config.wait_s:g} s")
        wait_for_peers(bus, bus_config, wait_for, stop, node.idle)
        if wait_for and not stop.is_set():
            report("joined", " and ".join(wait_for))
        process.event("START", granted)
        begun.set()
        how_long = f"for {duration_s:g} s" if duration_s > 0 else "until Ctrl-C"
        report("running", f"rig {rig.name} at {bus_config.endpoint}, {how_long}; {granted}")
        if latch_problem:
            process.event(
                "STATE_FOLDER", f"{latch_problem}: a stop cannot be kept over a restart, so the rig starts disarmed"
            )
        if keeper is not None and keeper.problem:
            process.event("STATE_FOLDER", keeper.problem)
        for code, text in rig.notes:
            process.event(code, text)
        if keeper is not None and keeper.holder is not None:
            node.apply_order(HOLD)
        node.idle()
        advance = process.lockstep if lockstep else process.realtime
        advance(blocks, stop)
        process.end()
        report("ended", f"{'stopped' if stop.is_set() else 'at its end'}, after {node.block * block_s:.1f} s")
        bus.wait_until_alone(_GOODBYE_S)  # this process relays the messages of the others, so it leaves last
    return node.block


def wait_for_peers(
    bus: Bus, config: BusConfig, roles: list[str], stop: threading.Event, idle: Callable[[], object] = int
) -> None:
    """Wait until all `roles` are on the bus, or `stop` is set; `idle` is called each 0.2 s. Raises Fault NO_PEER."""
    until_s = time.monotonic() + config.wait_s
    missing = bus.wait_for(roles, 0.0)
    while missing and time.monotonic() < until_s and not stop.is_set():
        missing = bus.wait_for(roles, 0.2)
        idle()
    if missing and not stop.is_set():
        line = f"{config.endpoint}: no {' and no '.join(sorted(missing))} within {config.wait_s:g} s"
        raise Fault("NO_PEER", f"{line}; start the missing process, or wait longer with --wait S")


class GuardedRig:
    """The loop of a rig on a bus: fade, latch, kept gain, missing commands and run number are here, and in no adapter.

    Args:
        node: the rig behind its guard.
        bus: its session.
        keeper: keeps the operator's stop and finds a stop by file; None: neither.
        report: reports important events to the operator.
        kept: keeps the accepted gain of the exciter; None: not kept.
        warmth: keeps the warmth of the exciter; None: not kept.

    """

    def __init__(
        self,
        node: GuardedNode,
        bus: Bus,
        keeper: Keeper | None,
        report: StepReport = no_report,
        kept: KeptGain | None = None,
        warmth: KeptHeat | None = None,
    ) -> None:
        self._node = node
        self._warmth, self._kept_heat = warmth, 0.0
        self._kept, self._accepted_gain = kept, node.accepted_gain
        self._report_step = report
        self._keeper = keeper
        self._guard_events = GuardEvents(lambda: self._node.gain_report)
        self._operator_orders, self._fault_orders = Inbox(16), Inbox(16)
        self._bus = bus
        self._complaints = Complaints(self.event)
        self._commands = CommandQueue(self._complaints)
        self._answers = Inbox(64)  # commands since the newest block was sent
        self._on_the_way: collections.deque[Received] = collections.deque(maxlen=WAITING)  # commands on the faulty bus
        self._events = 0
        self._paused_ns = 0  # length of a stall of this process that is not yet published
        self._send_sensors = bus.publisher(SENSORS)
        self._send_applied = bus.publisher(APPLIED)
        self._send_announce = bus.publisher(ANNOUNCE)
        self._send_event = bus.publisher(PLANT_EVENT)
        bus.listen(COMMAND, self._receive)
        bus.listen(OPERATOR, self._operator_orders.push)
        bus.listen(FAULT, self._fault_orders.push)

    def _receive(self, received: Received) -> None:
        # while a bus fault acts, the loop passes the commands through it first
        (self._on_the_way.append if self._node.faults.on_the_bus else self._commands.push)(received)
        self._answers.push(received)

    def event(self, code: str, text: str) -> None:
        """Publish an event with a code and a text."""
        t_ns = self._node.block * self._node.block_ns
        event = wire.Event(sequence=self._events, t_ns=t_ns, source="plant", code=code, text=text)
        self._events += 1
        self._send_event(event.SerializeToString())
        if is_listed(code):
            self._report_step(code, text)

    def end(self) -> None:
        """Publish END and withdraw the rig's liveliness token; the other processes end once they see both."""
        self._complaints.report_when_due(all_of_it=True)
        self._report_stall()
        rate_Hz = float(self._node.applied.sample_rate_Hz)
        self.event("END", f"blocks={self._node.block}{f' sample_rate_Hz={rate_Hz:.1f}' if rate_Hz else ''}")
        self._bus.withdraw()

    def _send(self, messages: Sequence[Outgoing]) -> None:
        """Send the messages of a block, if the rig made one, through the faults of the bus; publish new events."""
        if messages:
            sensors, applied = messages
            faults = self._node.faults
            for message in self._node.announcements:
                self._send_announce(message.payload)
            if faults.on_the_bus:
                for message in faults.on_the_way("blocks", [Message(sensors.payload)], self._node.block - 1):
                    self._send_sensors(message.payload)
            else:
                self._send_sensors(sensors.payload)
            realtime.let_the_bus_send()
            self._send_applied(applied.payload)
        self._publish_events()
        for code, text in self._node.faults.news():
            self.event(code, text)
        for code, text, times in self._node.problems():
            self._complaints.note(code, "device", text, times)

    def _let_commands_arrive(self) -> None:
        """Pass the received commands through the faults of the bus."""
        # a receiving thread may add more during the call
        taken = [self._on_the_way.popleft() for _ in range(len(self._on_the_way))]
        taken = [Message(received.payload, received) for received in taken]
        for message in self._node.faults.on_the_way("commands", taken, self._node.block - 1):
            self._commands.push(message.of._replace(payload=message.payload))

    def _apply_orders(self) -> None:
        """Apply the operators' orders since the last block; report and ignore unreadable ones.

        Orders over the bus are at most 16 a block, and their events one a second for each action.
        """
        keeper = self._keeper
        while (received := self._operator_orders.get()) is not None:
            try:
                order = parsed(wire.Operator, received.payload, OPERATOR.name)
                name = wire.Operator.Action.Name(order.action)
            except (Fault, ValueError) as error:
                self._complaints.note("OPERATOR", "ignored", str(error))
                continue
            self._node.apply_order(order.action)
            self._complaints.order(name, order.who)
            if keeper is not None and order.action == STOP:
                keeper.keep_stop(order.who)
            elif keeper is not None and order.action == RESET:
                keeper.clear_stop()
        if keeper is not None and (sender := keeper.holder) is not None and not self._node.is_stopped:
            self._node.apply_order(STOP)
            self._complaints.order("STOP", sender, ", by file")

    def _take_orders(self) -> None:
        """Plan the requested faults from the block after the next one on; report and drop malformed requests."""
        while (received := self._fault_orders.get()) is not None:
            try:
                self._node.faults.take(received.payload, self._node.block + 1)
            except Fault as fault:
                self._complaints.note(BAD_MESSAGE, FAULT.name, f"{fault.line.partition(': ')[2]}: dropped")

    def _keep(self, state: StateFile, write: Callable[[], None], lost: str) -> None:
        """Keep a state over restarts by `write`, in the keeper's thread."""
        if self._keeper is not None:
            self._keeper.keep(state, write, lost)

    def _publish_events(self) -> None:
        applied = self._node.applied
        for code, text in self._guard_events.news(applied):
            self.event(code, text)
            if code == "GUARD" and (kept := self._kept) is not None and self._accepted_gain != self._node.accepted_gain:
                self._accepted_gain = self._node.accepted_gain
                lost = "the next run of this rig has no gain to compare with"
                self._keep(kept, partial(kept.save, self._accepted_gain), lost)
        heat_share = float(applied["heat_share"])
        if (warmth := self._warmth) is not None and abs(heat_share - self._kept_heat) > _HEAT_STEP:
            self._kept_heat = heat_share
            self._keep(
                warmth, partial(warmth.save, heat_share), "the next run of this rig counts its exciter as colder"
            )
        if refused := int(applied["commands_refused"]):
            text = "refused; does a controller of an earlier run still run?"
            self._complaints.note(FOREIGN, f"{COMMAND.name} of another run, or not newer than the last", text, refused)

    def realtime(self, blocks: int, stop: threading.Event) -> None:
        """Advance one block per period by the computer's clock, as `loop` does."""
        carry_out(self.loop(blocks, stop))

    def loop(self, blocks: int, stop: threading.Event) -> Generator[Wait]:
        """Advance one block per period under the newest command; on every exit the vibration fades to zero first."""
        try:
            yield from self._advance_to(blocks, stop)
        finally:
            yield from self._fade_out(paced=True)

    def _fade_out(self, paced: bool) -> Generator[Wait]:
        node, pacer = self._node, realtime.Pacer(self._node.block_ns)
        node.let_go()
        for tick in range(_LONGEST_FADE_BLOCKS):
            if node.at_rest:
                return
            late_ns = 0
            if paced and not node.paced_by_rig:
                yield from pacer.wait(tick)
                late_ns = pacer.late_ns
            self._send(node.advance([], 0, 0, late_ns))

    def _advance_to(self, blocks: int, stop: threading.Event) -> Generator[Wait]:
        node, pacer = self._node, realtime.Pacer(self._node.block_ns)
        sent_ns = [0] * _ROUND_TRIPS_KEPT
        tick = 0
        longest_wait_s = _ANSWER_SHARE * node.block_ns * 1e-9
        remind_ticks = _REMIND_NS // node.block_ns
        while node.block < blocks and not stop.is_set():
            late_ns = 0
            if not node.paced_by_rig:
                yield from pacer.wait(tick)
                late_ns = pacer.late_ns
            elif not node.is_behind:  # a command after the newest block acts while the device makes the next one
                self._answers.get(longest_wait_s)
            if tick % remind_ticks == 0 and (text := self._bus.expiring()):
                self.event("CERTIFICATE", text)
            tick += 1
            self._apply_orders()
            self._take_orders()
            if node.faults.on_the_bus or self._on_the_way:
                self._let_commands_arrive()
            commands: list[bytes] = []
            round_trip_ns = 0
            late_commands = 0
            for received, answered in self._commands.take(node.block):
                commands.append(received.payload)
                if node.block - answered <= _ROUND_TRIPS_KEPT:
                    round_trip_ns = received.arrival_ns - sent_ns[answered % _ROUND_TRIPS_KEPT]
                    late_commands += round_trip_ns > LATE_NS
            messages = node.advance(commands, late_commands, round_trip_ns, late_ns)
            sent_ns[(node.block - 1) % _ROUND_TRIPS_KEPT] = time.perf_counter_ns()
            # a late answer would end the wait for the next one, so that each is late
            while self._answers.get() is not None:
                pass
            self._send(messages)
            late_ns = int(node.applied["late_ns"])
            self._complaints.report_when_due()
            if self._keeper is not None:
                self._keeper.at_rest = node.is_stopped and node.at_rest
            if late_ns > _PAUSE_NS:
                self._paused_ns = max(self._paused_ns, late_ns)
            elif late_ns < node.block_ns and commands:  # commands arrive again: the link is up
                self._report_stall()

    def _report_stall(self) -> None:
        if self._paused_ns:
            text = f"this rig stalled for {self._paused_ns * 1e-9:.2f} s; its overdue blocks followed at once"
            self.event("PAUSED", text)
            self._paused_ns = 0

    def lockstep(self, blocks: int, stop: threading.Event) -> None:
        """Advance block by block; each block waits for the command that answers the block before.

        Before its end the vibration fades to zero on a stop and after a fault; a whole run has as many blocks as in one process.
        """
        node = self._node
        commands: list[bytes] = []
        try:
            while node.block < blocks and not stop.is_set():
                self._apply_orders()
                self._send(node.advance(commands))
                commands = [self._answer(node.block - 1, stop)]
        finally:
            if node.block < blocks:
                carry_out(self._fade_out(paced=False))

    def _answer(self, block: int, stop: threading.Event) -> bytes:
        until_s = time.monotonic() + _ANSWER_TIMEOUT_S
        while time.monotonic() < until_s and not stop.is_set():
            received = self._answers.get(0.1)
            if received is not None:
                if self._commands.answered(received, block + 1) == block:
                    return received.payload
            elif not self._bus.alive("controller"):
                raise Fault("PEER_DIED", f"the controller left the bus; block {block} got no answer")
        if stop.is_set():
            return b""
        raise Fault("LOCKSTEP_STALLED", f"block {block}: no command answered it within {_ANSWER_TIMEOUT_S:g} s")
