"""A test of a real rig in real time: its processes, an operator that arms it, then steps and faults at their times."""

import contextlib
import json
import socket
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from bridge.faults import Fault
from bridge.log.logfile import read_run
from bridge.plain import print_line
from bridge.processes import pid_here
from bridge.rig.faults.kinds import PROCESS
from bridge.wire import realtime
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.payloads import parsed
from bridge.wire.session import rig_security
from bridge.wire.topics import APPLIED, FAULT, OPERATOR
from bridge.wire.zenoh_link import Bus, BusConfig, Inbox
from cockpit.faults.injection import disturb
from cockpit.live.operator import send_command
from cockpit.run.device_run import DeviceRun
from cockpit.run.processes import run_processes

_LOOK_S = 0.05  # longest wait for a message, after which the end of the run is noticed
_START_S = 300.0  # longest time until the log begins: a compilation on a busy computer; the test must end
_SILENT_S = 5.0  # silence of the rig that ends the test
_WAITING = (
    20_000  # blocks that wait while the rig is checked, 1.7 s; fewer are dropped, and with them the moment of arming
)
_WHO = "stickslip test"


def run_in_real_time(run: DeviceRun, name: str, settings: list[str], log: Path, arm: bool) -> None:
    """Run a real rig, and bring it to rest.

    Args:
        run: its configuration.
        name, settings: that give the same configuration.
        log: is written.
        arm: arm the rig first; the times of the run count from then.

    Raises Fault: NOT_JUDGED if the rig was not armed, QUARANTINED if the log does not show that the vibration ended.

    """
    for refused, why in (
        (any(step.settings for step in run.step), "step.settings: the controller of a real rig is a separate process"),
        (any(fault.kind == "restarted" for fault in run.fault), "fault: a process of this test cannot be restarted"),
        (
            run.controller.policy.enabled_from_s > 0.0,
            "controller.policy.enabled_from_s: counts from before the rig is armed",
        ),
    ):
        if refused:
            raise Fault("NOT_JUDGED", f"{name}: {why}; test it without --rig")
    bus = run.bus.model_copy(update={"endpoint": _free_endpoint()})
    rig_security(bus)
    changed = [*settings, "duration_s=0.0", "fault=[]", "step=[]", "expect=[]", "must_fail=[]"]
    changed += ["arm=false", f'bus.endpoint="{bus.endpoint}"']
    arguments = ["--scenario", name, *(part for setting in changed for part in ("--set", setting))]
    conductor = _Conductor(run, bus, arm)
    print_line(f"starting {name} on rig {run.rig.name}, for {run.duration_s:g} s{' once it is armed' if arm else ''}")
    try:
        run_processes(arguments, bus.endpoint, log, False, conductor.conduct, _START_S, conductor.processes)
    finally:
        if conductor.begun:
            _check_rest(run, log)
    if conductor.problem is not None:
        raise conductor.problem


def _free_endpoint() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


def _check_rest(run: DeviceRun, log: Path) -> None:
    try:
        applied = read_run(log).applied
        rests = len(applied) > 0 and applied["amplitude_m"][-1] == 0.0
    except Fault:
        rests = False
    if not rests:
        line = f"{run.rig.name}: the log does not show that the exciter rests: its last amplitude must be 0"
        raise Fault("QUARANTINED", f"{line}; look at the rig, then `stickslip rig release {run.rig.name}`")


class _Conductor:
    """Arms a rig on its bus, makes the changes of the scenario at their times, and ends the run."""

    def __init__(self, run: DeviceRun, config: BusConfig, arm: bool) -> None:
        self._run, self._config, self._arm = run, config, arm
        self.processes = {fault.target for fault in run.fault if fault.group == PROCESS}
        self.begun = False  # the rig answered
        self.problem: Exception | None = None

    def conduct(self, over: threading.Event) -> None:
        """Follow the run until `over` is set, and set it."""
        try:
            with realtime.raised_priority():  # on busy cores a change was 2.9 s late without it
                while not over.is_set() and not self.begun:
                    with contextlib.suppress(Fault), Bus(self._config, "operator", lockstep=False, stop=over) as bus:
                        try:
                            self._follow(bus, over)
                        except Exception as error:  # the thread of the run raises it
                            self.problem = error
        finally:
            over.set()

    def _follow(self, bus: Bus, over: threading.Event) -> None:
        run, blocks = self._run, self._blocks(bus, over)
        for _ in blocks:
            self.begun = True
            break
        headers = bus.headers(self.processes, _SILENT_S, over) if self.processes else {}
        pids = {role: pid_here(role, header.process) for role, header in headers.items()}
        changes = self._changes(bus, pids)
        if self._arm and not over.is_set():
            answer = send_command(self._config, "ARM")
            if not answer.done:
                raise Fault("NOT_JUDGED", f"{run.rig.name}: was not armed: {answer.cause}: {answer.help}")
        begin_ns: int | None = None
        for block in blocks:
            if begin_ns is None and self._arm and block.guard_state not in (wire.ARMED, wire.ACTIVE):
                continue
            begin_ns = block.t_ns if begin_ns is None else begin_ns
            t_s = (block.t_ns - begin_ns) * 1e-9
            while changes and changes[0][0] <= t_s:
                changes.pop(0)[1]()
            if t_s >= run.duration_s:
                return

    def _blocks(self, bus: Bus, over: threading.Event) -> Iterator[wire.Applied]:
        """The blocks of the rig until the end of the run. Raises Fault NO_PEER for a rig that fell silent."""
        inbox = Inbox(_WAITING)
        bus.listen(APPLIED, inbox.push)
        heard_s = time.monotonic()
        while not over.is_set():
            received = inbox.get(_LOOK_S)
            if received is not None:
                heard_s = time.monotonic()
                yield parsed(wire.Applied, received.payload, APPLIED.name)
            elif self.begun and time.monotonic() > heard_s + _SILENT_S:
                block_ms = 1e3 * self._run.rig.converter.block_s
                line = f"{self._run.rig.name}: silent for {_SILENT_S:g} s: must send a block each {block_ms:g} ms"
                raise Fault("NO_PEER", f"{line}; look at its events in the log")

    def _changes(self, bus: Bus, pids: dict[str, int]) -> list[tuple[float, Callable[[], object]]]:
        """Steps and faults of the scenario in order of time [s], each with the call that makes it."""
        operator, inject = bus.publisher(OPERATOR), bus.publisher(FAULT)
        changes: list[tuple[float, Callable[[], object]]] = []
        for step in self._run.step:
            command = wire.Operator(action=step.command, who=_WHO).SerializeToString()
            changes.append((step.at_s, partial(operator, command)))
        for fault in self._run.fault:
            now = fault.model_copy(update={"from_s": 0.0})
            if fault.group == PROCESS:
                worker = threading.Thread(target=disturb, args=(now, pids[fault.target]), daemon=True)
                changes.append((fault.from_s, worker.start))
            else:
                text = json.dumps(now.model_dump(mode="json"))
                order = wire.Inject(fault=text, who=_WHO, id=uuid.uuid4().hex)
                changes.append((fault.from_s, partial(inject, order.SerializeToString())))
        return sorted(changes, key=lambda change: change[0])
