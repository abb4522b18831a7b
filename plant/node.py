"""The rig as a participant of the bus: commands in, sensor blocks and the applied vibration out."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from bridge.faults import Fault
from bridge.guard.check import gain_report
from bridge.guard.core import NO_COMMAND
from bridge.guard.states import LEAVE, apply_order
from bridge.kernel_cache import compile_once
from bridge.wire.channels import CHANNELS
from bridge.wire.messages import APPLIED as APPLIED_LAYOUT
from bridge.wire.messages import COMMAND as COMMAND_LAYOUT
from bridge.wire.messages import sealed, sensor_block
from bridge.wire.stickslip_pb2 import FAULT, STOP_BY_PERSON, STOP_KEPT
from bridge.wire.topics import ANNOUNCE, APPLIED, COMMAND, SENSORS, Outgoing
from plant.config import RigConfig
from plant.faults.schedule import Faults
from plant.faults.table import FaultTable
from plant.inputs import RigInputs
from plant.piezo import base_velocity_mps
from plant.records import TRUTH, build, guard_records
from plant.step import act, report

_VELOCITY = TRUTH.index("true_velocity_mps")
_BATCH_BLOCKS = 64  # noise and drive velocity are drawn for this many blocks at once; fewer take more time per block


class PlantNode:
    """The rig, advanced block by block.

    Args:
        config: the rig file.
        seed: seed of the sensor noise; the same seed gives the same bytes.
        run: the number that each command must carry.
        arm: start ARMED, as only a simulated rig may.
        faults: injected into the rig.

    """

    def __init__(
        self, config: RigConfig, seed: int, run: int = 1, arm: bool = False, faults: Sequence[FaultTable] = ()
    ) -> None:
        self.block_ns = round(config.solver.block_s * 1e9)
        self.block = 0  # number of the next block
        self._config = config
        self._params, self._state = build(config)
        self._guard_params, self._guard_state = guard_records(config, run, arm)
        self._inputs = RigInputs(config, seed)
        samples = config.solver.samples_per_block
        self.faults = Faults(faults, seed, config.solver.block_s, samples, self._params)
        self._analogue = np.zeros((len(CHANNELS), samples))
        self.truth = np.empty((len(TRUTH), samples))  # true quantities in the last block, rows as plant.records.TRUTH
        self._drawn = self._inputs.draw(0)
        self._announced = 0  # number of the drawn announcements already sent
        self.announcements: list[Outgoing] = []  # to be sent before the samples of the last block
        self._sensors = sensor_block(samples).blank()
        self._applied = APPLIED_LAYOUT.blank()

    def warm_up(self) -> None:
        """Compile or load the kernel on copies, so that the first block is not late."""
        compile_once("the plant", self._step_copies)

    def _step_copies(self) -> None:
        guard = self._guard_state.copy()
        apply_order(guard[0], LEAVE)
        state, sensors, noise = self._state.copy(), sensor_block(self._analogue.shape[1]).blank(), self._analogue.copy()
        act(
            self._params, state, self._guard_params, guard, 0.0, COMMAND_LAYOUT.blank(0), 0, self._drawn.announce,
            noise, self._analogue, self.truth, sensors,
        )  # fmt: skip
        report(self._params, state, self._guard_params, guard, 0, 0, 0, 0, sensors, APPLIED_LAYOUT.blank())

    def advance(
        self, commands: list[bytes], commands_late: int = 0, round_trip_ns: int = 0, late_ns: int = 0
    ) -> tuple[Outgoing, Outgoing]:
        """Advance one block under the newest of `commands` accepted by the guard; return sensor block and applied vibration.

        Send `announcements` before them.

        Raises Fault BAD_MESSAGE if the command cannot be read, CONFIG if the state becomes NaN or infinite: the rig cannot be
        stepped.
        """
        faults = self.faults
        if faults.busy:
            faults.begin_block(self.block)
        payloads = b"".join(COMMAND_LAYOUT.canonical(payload, COMMAND.name) for payload in commands)
        at = self.block % _BATCH_BLOCKS
        if at == 0:
            self._drawn = self._inputs.draw(_BATCH_BLOCKS)
            self._announced = 0
        velocity_mps, noise, delay_blocks, announcements, announce = self._drawn
        first, self._announced = self._announced, self._announced + int(announcements[at])
        self.announcements = [
            Outgoing(ANNOUNCE, announce[row : row + 1].tobytes()) for row in range(first, self._announced)
        ]
        accepted = act(
            self._params, self._state, self._guard_params, self._guard_state, velocity_mps[at],
            COMMAND_LAYOUT.record(payloads), int(delay_blocks[at]), announce[first : self._announced], noise[at],
            self._analogue, self.truth, self._sensors,
        )  # fmt: skip
        if faults.busy:
            faults.spoil(self._sensors, self.block)
        report(
            self._params, self._state, self._guard_params, self._guard_state, accepted, commands_late, round_trip_ns, late_ns,
            self._sensors, self._applied,
        )  # fmt: skip
        if faults.busy:
            faults.misdate((self._sensors, self._applied), self.block)
        if not math.isfinite(self.truth[_VELOCITY, -1]):  # NaN anywhere in the state reaches the velocity within a step
            raise no_number(self._config, self.block)
        self.block += 1
        return Outgoing(SENSORS, sealed(self._sensors.tobytes())), Outgoing(APPLIED, self._applied.tobytes())

    def apply_order(self, order: int) -> bool:
        """Apply an operator's order (`wire.Operator.Action`), HOLD or LEAVE. Returns whether it changed the state."""
        return bool(apply_order(self._guard_state[0], order))

    @property
    def check_tones_Hz(self) -> list[float]:
        """Frequencies of the loop check."""
        p = self._guard_params[0]
        return [float(tone_Hz) for tone_Hz in p.tone_Hz[: int(p.tones)]]

    def accept_gain(self, gains: Sequence[float]) -> None:
        """Set the gains that later checks are compared with, one per tone, from an earlier run; empty: no comparison."""
        self._guard_state[0].accepted[: len(gains)] = gains

    def warm(self, heat_share: float) -> None:
        """Set the modelled warmth of the exciter from an earlier run, over the largest allowed."""
        self._guard_state["heat"] = heat_share

    @property
    def accepted_gain(self) -> list[float]:
        """The accepted exciter gain at each tone of the loop check; empty before the first check."""
        gains = [float(gain) for gain in self._guard_state[0].accepted[: int(self._guard_params[0].tones)]]
        return gains if all(gains) else []

    @property
    def gain_report(self) -> str:
        """The measured and the expected gain at each tone of the last loop check, as text."""
        return gain_report(self._guard_params[0], self._guard_state[0])

    @property
    def applied(self) -> Any:
        """The applied vibration of the last block, a record of `Applied`."""
        return self._applied[0]

    def let_go(self) -> None:
        """Drop all commands in force or delayed and enter DISARMED: the vibration fades to zero at the exciter's rate."""
        self._state["command_block"] = NO_COMMAND
        self._state["line_count"] = 0
        self.apply_order(LEAVE)

    @property
    def vibration_mps(self) -> float:
        """The true velocity amplitude v_a of the base at the end of the last block [m/s]."""
        return base_velocity_mps(self._params[0], self._state[0])

    @property
    def at_rest(self) -> bool:
        """Whether the base is at rest."""
        return self._state["amplitude_m"][0] == 0.0

    @property
    def is_stopped(self) -> bool:
        """Whether the guard is in FAULT because of an operator's stop."""
        s = self._guard_state[0]
        return s.state == FAULT and s.cause in (STOP_BY_PERSON, STOP_KEPT)


def no_number(config: RigConfig, block: int) -> Fault:
    """The fault of a rig whose state became NaN or infinite in a block."""
    solver = config.solver
    line = (
        f"{config.name}: the slide's velocity is not finite at {(block + 1) * solver.block_s:.3f} s: this rig cannot be stepped "
        f"with solver.step_s = {solver.step_s:g}; shorten it, or weaken extreme values"
    )
    return Fault("CONFIG", line)
