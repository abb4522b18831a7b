"""Plant and controller in turns, many blocks per call of compiled code: the interpreter does not slow a run down."""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.guard.core import accept
from bridge.guard.estimates import expect_drive
from bridge.guard.states import apply_order
from bridge.kernel import unlocked_kernel
from bridge.kernel_cache import compile_once
from bridge.wire.messages import APPLIED, CHANNELS, COMMAND, TRACE, Records, sensor_block
from controller.announced import take_announcement
from controller.codes import ANNOUNCED, BLOCK
from controller.config import ControllerConfig
from controller.core import step as controller_step
from controller.records import build as controller_records
from plant.config import RigConfig
from plant.inputs import InputsAhead, RigInputs
from plant.records import TRUTH, guard_records
from plant.records import build as plant_records
from plant.step import step as plant_step

_VELOCITY = TRUTH.index("true_velocity_mps")


@unlocked_kernel
def advance_both(
    plant_params: npt.NDArray[Any],
    plant_state: npt.NDArray[Any],
    guard_params: npt.NDArray[Any],
    guard_state: npt.NDArray[Any],
    velocity_mps: npt.NDArray[np.float64],
    delay_blocks: npt.NDArray[np.int64],
    noise: npt.NDArray[np.float64],
    controller_params: npt.NDArray[Any],
    controller_state: npt.NDArray[Any],
    operator_events: int,
    announcements: npt.NDArray[np.int64],
    announce: npt.NDArray[Any],
    answered: int,
    analogue: npt.NDArray[np.float64],
    truth: npt.NDArray[np.float64],
    sensors: npt.NDArray[Any],
    applied: npt.NDArray[Any],
    commands: npt.NDArray[Any],
    traces: npt.NDArray[Any],
) -> int:
    """Advance the rig and its controller by many blocks, in place; return how many were done.

    Args:
        plant_params, plant_state, guard_params, guard_state, controller_params, controller_state: one record each.
        velocity_mps: of the drive, [blocks].
        delay_blocks: additional delay of the command on its way to the exciter, [blocks].
        noise: standard normal numbers, [blocks, 5, samples].
        operator_events: bits STOP and RESET of `controller.codes`, for the first block.
        announcements: number of announcements that the rig makes before each block's samples, [blocks].
        announce: these announcements in order, message records.
        answered: 1 if `commands[0]` answers the block before the first, 0 at the start of a run.
        analogue, truth: [5, samples] and [6, samples], overwritten by every block.
        sensors, applied, traces: message records [blocks], filled.
        commands: message records [blocks + 1]; the rig receives the first with the first block, the others are filled.

    Stops early, before a block in which the slide's velocity becomes NaN or infinite.

    """
    last, announced = truth.shape[1] - 1, 0
    for i in range(velocity_mps.shape[0]):
        received = answered if i == 0 else 1
        if received == 1 and not accept(guard_params[0], guard_state[0], commands[i]):
            received = 0
        first, announced = announced, announced + announcements[i]
        for row in range(first, announced):
            expect_drive(guard_state[0], announce[row].drive_velocity_mps)
        plant_step(
            plant_params, plant_state, guard_params, guard_state, velocity_mps[i], commands[i : i + 1], received,
            delay_blocks[i], noise[i], 0, 0, 0, analogue, truth, sensors[i : i + 1], applied[i : i + 1],
        )  # fmt: skip
        if not math.isfinite(truth[_VELOCITY, last]):
            return i
        events = BLOCK | operator_events if i == 0 else BLOCK
        for row in range(first, announced):
            take_announcement(controller_state[0], announce[row].holds_from_ns, announce[row].drive_velocity_mps)
            events |= ANNOUNCED
        controller_step(
            controller_params, controller_state, sensors[i : i + 1], events, 0, sensors[i].t_ns,
            commands[i + 1 : i + 2], traces[i : i + 1],
        )  # fmt: skip
    return velocity_mps.shape[0]


class StretchMessages(NamedTuple):
    """Messages of one stretch of a run, [blocks] each."""

    sensors: Records
    applied: Records
    command: Records
    trace: Records
    announce: Records  # [announcements]


class ClosedLoop:
    """A rig and its controller in lockstep.

    Args:
        rig: the rig file.
        seed: of the sensor noise.
        config: the controller's configuration, with the `block_s` and `samples_per_block` of the rig.
        arm: whether the rig starts ARMED.

    """

    def __init__(self, rig: RigConfig, seed: int, config: ControllerConfig, arm: bool) -> None:
        self.block = 0  # number of the next block
        self.block_ns = round(rig.solver.block_s * 1e9)
        self.controller_state: npt.NDArray[Any]
        samples = rig.solver.samples_per_block
        self._rig = rig
        self._inputs = InputsAhead(RigInputs(rig, seed))
        self._sensors = sensor_block(samples)
        self._plant_params, self._plant_state = plant_records(rig)
        self._guard_params, self._guard_state = guard_records(rig, 1, arm)
        self._controller_params, self.controller_state = controller_records(config)
        self._analogue, self._truth = np.empty((len(CHANNELS), samples)), np.empty((len(TRUTH), samples))
        self._last_command = COMMAND.blank()

    def warm_up(self) -> None:
        """Compile or load the kernel, so that the log begins when the run does."""
        compile_once("a run in one process", lambda: self.advance(0))

    def reconfigure(self, config: ControllerConfig) -> None:
        """Continue with another configuration of the controller and its present memory."""
        self._controller_params, _ = controller_records(config)

    def apply_order(self, word: int) -> None:
        """The rig receives an operator command, a `wire.Operator.Action`, before its next block."""
        apply_order(self._guard_state[0], word)

    def advance(self, blocks: int, operator_events: int = 0) -> StretchMessages:
        """Advance by `blocks`; the controller receives `operator_events` in the first block.

        Returns fewer blocks if the rig's state became NaN or infinite in the block after them.
        """
        velocity_mps, noise, delay_blocks, announcements, announce = self._inputs.draw(blocks)
        commands = COMMAND.blank(blocks + 1)
        commands[:1] = self._last_command
        sensors, applied, trace = self._sensors.blank(blocks), APPLIED.blank(blocks), TRACE.blank(blocks)
        done = advance_both(
            self._plant_params, self._plant_state, self._guard_params, self._guard_state, velocity_mps, delay_blocks, noise,
            self._controller_params, self.controller_state, operator_events, announcements, announce, min(self.block, 1),
            self._analogue, self._truth, sensors, applied, commands, trace,
        )  # fmt: skip
        self.block += done
        self._last_command = commands[done : done + 1]
        announced = announce[: int(announcements[:done].sum())]
        return StretchMessages(sensors[:done], applied[:done], commands[1 : done + 1], trace[:done], announced)
