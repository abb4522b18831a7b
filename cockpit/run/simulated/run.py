"""A scenario in simulated time, with its faults: the unchanged loops of plant and controller, and the truth of the rig."""

import threading
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, cast

import numpy as np
import numpy.typing as npt

from bridge.faults import Fault
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.inbox import WAITING
from bridge.wire.session import LEASE_S
from bridge.wire.topics import OPERATOR, TOPICS, Outgoing
from cockpit.run.in_process import TimedAction
from cockpit.run.scenario import Scenario
from cockpit.run.simulated.bus import Hub, Receive, Session
from cockpit.run.simulated.stage import Player, Stage, WaitingInbox
from controller.app import ControllerProcess
from controller.node import ControllerNode
from plant.app import PlantProcess
from plant.faults.kinds import PROCESS
from plant.faults.table import FaultTable
from plant.node import PlantNode
from plant.records import TRUTH

_LINKED_S = 0.05  # time from the resumption of a frozen process to its new link
_LONGEST_AFTER_S = 2.0  # time after the last block for the fade-out and the end of the processes
_POSITION, _VELOCITY = TRUTH.index("true_drive_position_m"), TRUTH.index("true_velocity_mps")
_GRANTED = "simulated time"  # text of the events START


class Truth(NamedTuple):
    """True motion of the rig, [blocks] each."""

    t_s: npt.NDArray[np.float64]  # simulated time at the end of each block
    vibration_mps: npt.NDArray[np.float64]  # v_a of the base
    drive_mps: npt.NDArray[np.float64]  # v_d, mean of the block
    slide_mps: npt.NDArray[np.float64]  # slide velocity of largest magnitude in the block, negative backwards


class _TruthNode(PlantNode):
    """A rig that appends the truth of each block to a list."""

    def __init__(self, truths: list[tuple[float, float, float, float]], now_ns: Callable[[], int], **rest: Any) -> None:
        PlantNode.__init__(self, **rest)
        self._truths, self._now_ns = truths, now_ns
        self._drive_m = 0.0

    def advance(
        self, commands: list[bytes], commands_late: int = 0, round_trip_ns: int = 0, late_ns: int = 0
    ) -> tuple[Outgoing, Outgoing]:
        """Advance one block."""
        sent = PlantNode.advance(self, commands, commands_late, round_trip_ns, late_ns)
        drive_m, speeds = float(self.truth[_POSITION, -1]), self.truth[_VELOCITY]
        drive_mps = (drive_m - self._drive_m) / (self.block_ns * 1e-9)
        self._drive_m = drive_m
        fastest_mps = float(speeds[np.abs(speeds).argmax()])
        self._truths.append((self._now_ns() * 1e-9, self.vibration_mps, drive_mps, fastest_mps))
        return sent


class SimulatedRun:
    """One run. Runs share the simulated clock, so a process can make only one at a time.

    Args:
        scenario: the scenario with its faults, faults of processes included.
        words: operator commands with their times.
        arm: whether the rig starts ARMED; the scenario's value if not given.

    """

    def __init__(self, scenario: Scenario, words: Sequence[TimedAction] = (), arm: bool | None = None) -> None:
        self._scenario = scenario
        self._arm = scenario.arm if arm is None else arm
        self._stage = Stage()
        self._hub = Hub(self._stage)
        self._stop = threading.Event()
        self._truths: list[tuple[float, float, float, float]] = []
        self._players: dict[str, Player] = {}
        self._runs = 0
        self.ended: dict[str, Fault] = {}  # faults that ended processes, by role
        faults = [table for table in scenario.fault if table.group == PROCESS]
        for table in faults:
            self._stage.cue(round(table.from_s * 1e9), lambda table=table: self._disturb(table))
        for order in words:
            self._stage.cue(order.t_ns, lambda order=order: self._send(order))

    def listen(self, receive: Receive) -> None:
        """Receive every message of the run, as a recorder does."""
        for topic in TOPICS:
            self._hub.listen("recorder", topic, receive)

    def play(self, stopped: Callable[[], bool] = lambda: False) -> Truth:
        """Run to the end of the scenario. Raises the Fault of a process.

        Args:
            stopped: called at every turn; True ends the run like Ctrl-C.

        """
        self._begin_controller()
        self._begin_plant(first=True)
        until_ns = round((self._scenario.duration_s + _LONGEST_AFTER_S) * 1e9)

        def over() -> bool:
            if stopped():
                self._stop.set()
            return self._stage.now_ns > until_ns if self._scenario.duration_s else False

        self._stage.play(over, self._silence, self._failed)
        rows = np.array(self._truths).reshape(-1, 4)
        return Truth(*rows.T)

    def _silence(self) -> None:
        """Drop the messages that processes send while they are removed after the run."""
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
        node = _TruthNode(
            self._truths,
            lambda: stage.now_ns,
            config=scenario.rig,
            seed=scenario.seed,
            run=self._runs,
            arm=self._arm and first,
            faults=scenario.fault if first else (),
        )
        process = PlantProcess(node, cast(Any, Session(self._hub, "plant")), None)

        def work() -> None:
            process.event("START", _GRANTED)
            process.realtime(max(left, 0), self._stop)
            process.end()

        self._hub.announce("plant")
        self._players["plant"] = stage.enter(Player("plant", work))

    def _begin_controller(self) -> None:
        scenario, stage = self._scenario, self._stage
        inbox = WaitingInbox(WAITING, stage)
        session = cast(Any, Session(self._hub, "controller"))
        self._hub.down.discard("controller")
        process = ControllerProcess(
            scenario.controller, ControllerNode(scenario.controller), session, lockstep=False, inbox=inbox
        )
        process.prepare()
        self._hub.announce("controller")
        self._players["controller"] = stage.enter(Player("controller", lambda: process.loop(self._stop, _GRANTED)))

    def _send(self, order: TimedAction) -> None:
        command = wire.Operator(action=cast(Any, order.action), who="the operator")
        self._hub.put("cockpit", OPERATOR, command.SerializeToString())

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
        stage.remove(player)
        if table.kind == "restarted":
            begin = self._begin_controller if role == "controller" else lambda: self._begin_plant(first=False)
            stage.cue(stage.now_ns + for_ns, begin)
