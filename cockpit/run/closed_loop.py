"""Plant and controller in turns, many blocks per call of compiled code, as a call per block from Python would be slower."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from bridge.arrays import Floats, Records
from bridge.guard.check import gain_report
from bridge.guard.states import apply_order
from bridge.kernel import kernel, unlocked_kernel
from bridge.kernel_cache import compile_once
from bridge.wire.channels import CHANNELS
from bridge.wire.messages import ANNOUNCED, APPLIED, BLOCK, COMMAND, TRACE, sensor_block
from controller.announced import take_announcement
from controller.config import ControllerConfig
from controller.core import step as controller_step
from controller.records import build as controller_records
from plant.config import RigConfig
from plant.inputs import Inputs, InputsAhead, RigInputs
from plant.piezo import base_velocity_mps, delivered_share
from plant.records import TRUTH, guard_records, set_load
from plant.records import build as plant_records
from plant.step import act, report

_VELOCITY = TRUTH.index("true_velocity_mps")
Pair = tuple[Records, Records]  # parameters and memory, one record each


class Stretch(NamedTuple):
    """Messages of one stretch of a run, and the simulated truth; each array has [blocks], except the announcements."""

    sensors: Records
    applied: Records
    command: Records
    trace: Records
    announce: Records  # [announcements]
    truth: Floats  # [blocks, 6, samples], rows as `plant.records.TRUTH`
    v_a_mps: Floats  # v_a of the base at the end of each block
    frequency_Hz: Floats  # frequency of the exciter
    gain: Floats  # v_a over commanded amplitude at that frequency [1/s]


def advancing(answer: Callable[..., None]) -> Callable[..., int]:
    """Make the kernel that advances a rig and a subject, such as a controller, which answers each block by the kernel `answer`.

    Args:
        answer: fills row `i` of `made.command` and `made.trace`; its arguments are subject, i, announce, events, made.

    """

    def advance(
        plant: Pair,
        guard: Pair,
        subject: Any,
        inputs: Inputs,
        operator_events: int,
        command: Records,
        analogue: Floats,
        made: Stretch,
    ) -> int:
        """Advance by many blocks, in place; return the number of blocks done.

        Args:
            plant, guard: parameters and memory of each; the memory is advanced.
            subject: passed to `answer`.
            inputs: inputs of the rig.
            operator_events: bits STOP and RESET of `bridge.wire.messages`, for the first block.
            command: the answer to the block before the first, [1]; [0] at the start of a run.
            analogue: [5, samples], overwritten by every block.
            made: receives messages and truth.

        Stops early, before a block in which the slide's velocity becomes NaN or infinite.

        """
        p, s = plant[0][0], plant[1][0]
        announced, events = 0, BLOCK | operator_events
        for i in range(inputs.velocity_mps.shape[0]):
            first, announced = announced, announced + inputs.announcements[i]
            announce = inputs.announce[first:announced]
            truth, sensors, applied = made.truth[i], made.sensors[i : i + 1], made.applied[i : i + 1]
            accepted = act(
                plant[0], plant[1], guard[0], guard[1], inputs.velocity_mps[i], command, inputs.delay_blocks[i], announce,
                inputs.noise[i], analogue, truth, sensors,
            )  # fmt: skip
            report(plant[1], guard[0], guard[1], accepted, 0, 0, 0, sensors, applied)
            if not math.isfinite(truth[_VELOCITY, -1]):
                return i
            made.v_a_mps[i] = base_velocity_mps(p, s)
            made.frequency_Hz[i] = s.frequency_Hz
            made.gain[i] = delivered_share(p, s.frequency_Hz) * 2.0 * math.pi * s.frequency_Hz
            if s.amplitude_m > 0.0:
                made.gain[i] = made.v_a_mps[i] / s.amplitude_m
            answer(subject, i, announce, events, made)
            command, events = made.command[i : i + 1], BLOCK
        return inputs.velocity_mps.shape[0]

    return unlocked_kernel(advance)


@kernel
def _controller_answer(subject: Pair, i: int, announce: Records, events: int, made: Stretch) -> None:
    for row in range(announce.shape[0]):
        take_announcement(subject[1][0], announce[row].holds_from_ns, announce[row].drive_velocity_mps)
        events |= ANNOUNCED
    controller_step(
        subject[0], subject[1], made.sensors[i : i + 1], events, 0, made.sensors[i].t_ns, made.command[i : i + 1],
        made.trace[i : i + 1],
    )  # fmt: skip


_advance_both = advancing(_controller_answer)


class ClosedLoop:
    """A rig and its controller in lockstep; `config` has the `block_s` and `samples_per_block` of the rig."""

    def __init__(self, rig: RigConfig, seed: int, config: ControllerConfig, arm: bool) -> None:
        self.block = 0  # number of the next block
        self.block_ns = round(rig.solver.block_s * 1e9)
        self._rig = rig
        self._inputs = InputsAhead(RigInputs(rig, seed))
        self._sensors = sensor_block(rig.solver.samples_per_block)
        self._plant, self._guard = plant_records(rig), guard_records(rig, 1, arm)
        self._controller = controller_records(config)
        self._analogue = np.empty((len(CHANNELS), self._sensors.samples))
        self._last_command = COMMAND.blank(0)

    def warm_up(self) -> None:
        """Compile or load the kernel, so that the log begins when the run does."""
        compile_once("a run in one process", lambda: self.advance(0))

    @property
    def controller_state(self) -> Records:
        """The controller's memory."""
        return self._controller[1]

    @property
    def gain_report(self) -> str:
        """The measured and the expected gain at each tone of the last loop check, as text."""
        params, state = self._guard
        return gain_report(params[0], state[0])

    def reconfigure(self, config: ControllerConfig) -> None:
        """Continue with another configuration of the controller and its present memory."""
        self._controller = controller_records(config)[0], self.controller_state

    def set_load(self, ratio: float) -> None:
        """Set the normal load, in multiples of the load at the start, from the next block on."""
        set_load(self._plant[0], self._rig, ratio)

    def apply_order(self, action: int) -> None:
        """Give the rig an operator command, a `wire.Operator.Action`, before its next block."""
        apply_order(self._guard[1][0], action)

    def advance(self, blocks: int, operator_events: int = 0) -> Stretch:
        """Advance by `blocks`; the controller receives `operator_events` in the first block.

        Returns fewer blocks if the rig's state became NaN or infinite in the block after them.
        """
        return self._advance(_advance_both, self._controller, self._draw(blocks), operator_events)

    def _draw(self, blocks: int) -> Inputs:
        return self._inputs.draw(blocks)

    def _advance(self, advance: Callable[..., int], subject: Any, inputs: Inputs, operator_events: int = 0) -> Stretch:
        blocks = len(inputs.noise)
        truth = np.empty((blocks, len(TRUTH), self._sensors.samples))
        made = Stretch(
            self._sensors.blank(blocks), APPLIED.blank(blocks), COMMAND.blank(blocks), TRACE.blank(blocks),
            inputs.announce, truth, np.empty(blocks), np.empty(blocks), np.empty(blocks),
        )  # fmt: skip
        last = self._last_command
        done = advance(self._plant, self._guard, subject, inputs, operator_events, last, self._analogue, made)
        self.block += done
        if done:
            self._last_command = made.command[done - 1 : done]
        announced = made.announce[: int(inputs.announcements[:done].sum())]
        return Stretch(*(part[:done] for part in made))._replace(announce=announced)
