"""A scenario in simulated time, with its faults: the unchanged loops of plant and controller, and the log."""

import threading
from collections.abc import Callable, Generator, Iterable
from pathlib import Path
from typing import Any, cast

import numpy as np

from bridge.faults import Fault
from bridge.rig.device_node import DeviceNode
from bridge.rig.faults.kinds import PROCESS
from bridge.rig.faults.table import FaultTable
from bridge.rig.load import device_of
from bridge.rig.node import GuardedNode
from bridge.rig.process import GuardedRig
from bridge.rig.real import notes as device_notes
from bridge.rig.real import open_node
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.clock import Wait
from bridge.wire.complaints import BAD_MESSAGE, Complaints
from bridge.wire.inbox import Received
from bridge.wire.session import LEASE_S
from bridge.wire.topics import OPERATOR, SENSORS, TOPICS
from cockpit.run.device_run import DeviceRun
from cockpit.run.in_process import TimedAction, actions_of, log_of, run_onboard
from cockpit.run.scenario import Scenario
from cockpit.run.simulated.stage import Hub, Player, Receive, Session, Stage
from cockpit.run.step import configurations, with_speeds
from controller.app import ControllerProcess
from controller.config import ControllerConfig
from controller.node import ControllerNode
from plant.drive_config import DriveConfig
from plant.records import notes
from plant.rig.node import PlantNode

_LINKED_S = 0.05  # time from the resumption of a frozen process to its new link
_LONGEST_AFTER_S = 2.0  # time after the last block for the fade-out and the end of the processes
_GRANTED = "simulated time"  # text of the START events, in place of the granted real-time priority


class SimulatedRun:
    """One run with its faults. Runs share the simulated clock, so a process can make only one at a time."""

    def __init__(self, scenario: Scenario | DeviceRun) -> None:
        self._scenario = scenario
        self._config = scenario.controller
        self._stage = Stage()
        self._hub = Hub(self._stage)
        self._stop = threading.Event()
        self._players: dict[str, Player] = {}
        self._runs = 0
        self.ended: dict[str, Fault] = {}  # faults that ended processes, by role
        faults = [table for table in scenario.fault if table.group == PROCESS]
        for table in faults:
            self._stage.cue(round(table.from_s * 1e9), lambda table=table: self._disturb(table))
        self._loop_node: ControllerNode | None = None
        self._rig_node: GuardedNode | None = None
        self.command(actions_of(scenario))
        for t_ns, config in configurations(scenario.controller, scenario.step):
            self._stage.cue(t_ns, lambda config=config: self._reconfigure(config))
        for step in scenario.step:
            if step.load is not None:
                self._stage.cue(step.t_ns, lambda load=step.load: self._load(load))

    def command(self, orders: Iterable[TimedAction]) -> None:
        """Send operator commands at their times."""
        for order in orders:
            command = wire.Operator(action=cast(Any, order.action), who="the operator").SerializeToString()
            self._stage.cue(order.t_ns, lambda command=command: self._hub.put("cockpit", OPERATOR, command))

    def _reconfigure(self, config: ControllerConfig) -> None:
        self._config = config
        if self._loop_node is not None:
            self._loop_node.reconfigure(config)

    def _load(self, ratio: float) -> None:
        if isinstance(self._rig_node, PlantNode):
            self._rig_node.set_load(ratio)

    def listen(self, receive: Receive) -> None:
        """Receive every message of the run, as a recorder does."""
        for topic in TOPICS:
            self._hub.listen("recorder", topic, receive)

    def plant_node(self, **settings: Any) -> GuardedNode:
        """Create the rig's node. A subclass may override this, to record the simulated truth or for a device."""
        return PlantNode(**settings)

    def notes(self) -> list[tuple[str, str]]:
        """Codes and texts of the rig's events at its start. A subclass overrides this for a device."""
        return [] if isinstance(self._scenario, DeviceRun) else notes(self._scenario.rig)

    def controller_node(self) -> ControllerNode:
        """Create the controller. A subclass may override this to run a rule in its place."""
        return ControllerNode(self._config)

    def play(self, stopped: Callable[[], bool] = lambda: False) -> None:
        """Run to the end of the scenario; `stopped`, called at every turn, ends it like Ctrl-C. Raises the Fault of a process."""
        self._begin_controller()
        self._begin_plant(first=True)
        until_ns = round((self._scenario.duration_s + _LONGEST_AFTER_S) * 1e9)

        def over() -> bool:
            if stopped():
                self._stop.set()
            return self._stage.now_ns > until_ns if self._scenario.duration_s else False

        self._stage.play(over, self._silence, self._failed)

    def _silence(self) -> None:
        """Unsubscribe all roles, so that messages which processes send while they are removed do not reach the log."""
        for role in self._players:
            self._hub.forget(role)

    def _failed(self, player: Player) -> None:
        """A process ended with a fault: the others continue, as they do on the bus."""
        if not isinstance(player.failed, Fault) or player.name == "plant":
            raise player.failed or RuntimeError(player.name)
        self.ended[player.name] = player.failed
        self._hub.forget(player.name)

    def _begin_plant(self, first: bool) -> None:
        scenario, stage = self._scenario, self._stage
        self._runs += 1
        block_s = scenario.rig.solver.block_s
        left = round((scenario.duration_s - stage.now_ns * 1e-9) / block_s) if scenario.duration_s > 0 else 1 << 62
        node = self.plant_node(
            config=scenario.rig,
            seed=scenario.seed,
            run=self._runs,
            arm=scenario.arm and first,
            faults=scenario.fault if first else (),
        )
        self._rig_node = node
        process = GuardedRig(node, cast(Any, Session(self._hub, "plant")), None)

        def loop() -> Generator[Wait]:
            process.event("START", _GRANTED)
            for code, text in self.notes():
                process.event(code, text)
            yield from process.loop(max(left, 0), self._stop)
            process.end()

        self._hub.announce("plant")
        self._players["plant"] = stage.enter(Player("plant", loop()))

    def _begin_controller(self) -> None:
        session = cast(Any, Session(self._hub, "controller"))
        self._hub.down.discard("controller")
        self._loop_node = node = self.controller_node()
        process = ControllerProcess(self._config, node, session, lockstep=False)
        self._hub.announce("controller")
        self._players["controller"] = self._stage.enter(Player("controller", process.loop(self._stop, _GRANTED)))

    def _disturb(self, table: FaultTable) -> None:
        """Freeze, kill or restart a process now."""
        role, stage, hub = table.target, self._stage, self._hub
        if role not in self._players:  # a simulated run has no process for its recorder
            return
        player, for_ns = self._players[role], round(table.for_s * 1e9)
        if table.kind == "frozen":
            player.frozen_until_ns = stage.now_ns + for_ns
            if table.for_s > LEASE_S:
                stage.cue(stage.now_ns + round(LEASE_S * 1e9), lambda: hub.lose(role))
                stage.cue(stage.now_ns + for_ns + round(_LINKED_S * 1e9), lambda: hub.announce(role))
            return
        hub.forget(role)
        player.leave()
        if table.kind == "restarted":
            begin = self._begin_controller if role == "controller" else lambda: self._begin_plant(first=False)
            stage.cue(stage.now_ns + for_ns, begin)


class DevicesRun(SimulatedRun):
    """A run of a device that makes a block for each command, such as a model: simulated time, as nothing real moves.

    Args:
        run: its configuration.
        folder: of its rig file.
        arm: it starts ARMED.

    """

    def __init__(self, run: DeviceRun, folder: Path, arm: bool) -> None:
        super().__init__(run)
        self._run, self._folder, self._arm = run, folder, arm
        speeds = [step for step in run.step if step.speed_mps is not None]
        if speeds:
            start = DriveConfig(profile=[(0.0, device_of(run.rig, folder).speed_mps)])
            profile = np.array(with_speeds(start, speeds).profile)
            for step in speeds:
                until_s = step.at_s + step.ramp_s
                self._stage.cue(step.t_ns, lambda until_s=until_s: self._speed(profile, until_s))

    def plant_node(self, **settings: Any) -> GuardedNode:
        """Open the device; a rig that is started again opens it again."""
        self.close()
        run, arm = self._run, self._arm and settings["run"] == 1
        return open_node(run.rig, self._folder, settings["run"], settings["faults"], run.seed, arm)

    def notes(self) -> list[tuple[str, str]]:
        """The protection that the rig lacks."""
        return device_notes(self._run.rig, device_of(self._run.rig, self._folder).watchdog_s)

    def _load(self, ratio: float) -> None:
        self._set("load", ratio)

    def _set(self, name: str, value: float) -> None:
        if isinstance(self._rig_node, DeviceNode):
            self._rig_node.set(name, value)

    def _speed(self, profile: np.ndarray, until_s: float) -> None:
        """Set the drive's speed for the next block, and so on until a time."""
        t_s = self._stage.now_ns * 1e-9
        self._set("speed", float(np.interp(t_s, profile[:, 0], profile[:, 1])))
        if t_s < until_s:
            block_ns = round(self._run.rig.solver.block_s * 1e9)
            self._stage.cue(self._stage.now_ns + block_ns, lambda: self._speed(profile, until_s))

    def close(self) -> None:
        """Disconnect from the device."""
        if self._rig_node is not None:
            self._rig_node.close()


def run_with_faults(
    scenario: Scenario | DeviceRun,
    path: Path,
    about: dict[str, Any],
    progress: Callable[[float], None] | None = None,
    stopped: Callable[[], bool] = lambda: False,
    run: SimulatedRun | None = None,
) -> None:
    """Run a scenario with its faults and write its log. Raises Fault LOG_WRITE.

    `about` is metadata for the log; `progress` is called every 0.1 s of simulated time with that time [s]; `stopped`, called at
    every turn, ends the run as at its full duration; `run`: not given for a simulated rig.
    """
    run = run or SimulatedRun(scenario)
    log = log_of(scenario, path, about)
    complaints = Complaints(log.add_event)
    block_s = scenario.rig.solver.block_s
    every = max(round(0.1 / block_s), 1)
    blocks = 0

    def write(received: Received) -> None:
        nonlocal blocks
        if received.topic.logged:
            try:
                log.write(received.topic, received.payload)
            except Fault as fault:
                if fault.kind.code != "BAD_MESSAGE":
                    raise
                complaints.note(BAD_MESSAGE, received.topic.name, f"{fault.line.partition(': ')[2]}: dropped")
        if received.topic is SENSORS:
            blocks += 1
            if progress is not None and blocks % every == 0:
                progress(received.arrival_ns * 1e-9)

    run.listen(write)
    try:
        run.play(stopped)
    finally:
        log.close()


def simulate(scenario: Scenario, path: Path, about: dict[str, Any]) -> None:
    """Run a scenario in one process and write its log: many blocks at once without faults, else message by message."""
    (run_with_faults if scenario.fault else run_onboard)(scenario, path, about)
