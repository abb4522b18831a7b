"""The rig as a participant of the bus: commands in, sensor blocks and the applied vibration out."""

import math

import numpy as np

from bridge.faults import Fault
from bridge.kernel_cache import compile_once
from bridge.wire.messages import APPLIED as APPLIED_LAYOUT
from bridge.wire.messages import CHANNELS, sensor_block
from bridge.wire.messages import COMMAND as COMMAND_LAYOUT
from bridge.wire.topics import APPLIED, COMMAND, SENSORS, Outgoing
from plant.config import RigConfig
from plant.inputs import RigInputs
from plant.records import NO_COMMAND, TRUTH, build
from plant.step import step

_VELOCITY = TRUTH.index("true_velocity_mps")
_BATCH_BLOCKS = 64  # noise and drive velocity are drawn for so many blocks at once; fewer cost more time a block


class PlantNode:
    """The rig, advanced block by block.

    Args:
        config: the rig file.
        seed: seed of the sensor noise; the same seed gives the same bytes.

    """

    def __init__(self, config: RigConfig, seed: int) -> None:
        self.block_ns = round(config.solver.block_s * 1e9)
        self.block = 0  # number of the next block
        self._config = config
        self._params, self._state = build(config)
        self._inputs = RigInputs(config, seed)
        samples = config.solver.samples_per_block
        self._analogue = np.empty((len(CHANNELS), samples))
        self.truth = np.empty((len(TRUTH), samples))  # of the last block, rows as plant.records.TRUTH
        self._noise = np.zeros((_BATCH_BLOCKS, len(CHANNELS), samples))
        self._velocity_mps = np.zeros(_BATCH_BLOCKS)
        self._command = COMMAND_LAYOUT.blank()
        self._sensors = sensor_block(samples).blank()
        self._applied = APPLIED_LAYOUT.blank()

    def warm_up(self) -> None:
        """Compile or load the kernel on copies, so that the first block is not late."""
        compile_once("the plant", self._step_copies)

    def _step_copies(self) -> None:
        step(
            self._params, self._state.copy(), 0.0, self._command, 0, self._noise[0], 0, 0, 0,
            self._analogue, self.truth, sensor_block(self._noise.shape[2]).blank(), APPLIED_LAYOUT.blank(),
        )  # fmt: skip

    def advance(
        self, commands: list[bytes], commands_late: int = 0, round_trip_ns: int = 0, late_ns: int = 0
    ) -> tuple[Outgoing, Outgoing]:
        """Advance one block under the newest of `commands`; return the sensor block and the applied vibration.

        Raises Fault BAD_MESSAGE when the command cannot be read, CONFIG when the state becomes NaN or infinite, so that the
        rig cannot be stepped.
        """
        if commands:
            self._command = COMMAND_LAYOUT.read(commands[-1], COMMAND.name)
        at = self.block % _BATCH_BLOCKS
        if at == 0:
            self._velocity_mps, self._noise = self._inputs.draw(_BATCH_BLOCKS)
        step(
            self._params, self._state, self._velocity_mps[at], self._command, len(commands), self._noise[at],
            commands_late, round_trip_ns, late_ns, self._analogue, self.truth, self._sensors, self._applied,
        )  # fmt: skip
        if not math.isfinite(self.truth[_VELOCITY, -1]):  # NaN anywhere in the state reaches the velocity within a step
            raise no_number(self._config, self.block)
        self.block += 1
        return Outgoing(SENSORS, self._sensors.tobytes()), Outgoing(APPLIED, self._applied.tobytes())

    def let_go(self) -> None:
        """Forget the present command, so that the vibration fades to zero at the piezo's own rate."""
        self._state["command_block"] = NO_COMMAND

    @property
    def at_rest(self) -> bool:
        """Whether the base stands still."""
        return self._state["amplitude_m"][0] == 0.0


def no_number(config: RigConfig, block: int) -> Fault:
    """The fault of a rig whose state became NaN or infinite in a block."""
    solver = config.solver
    line = (
        f"{config.name}: the slide's velocity is no number at {(block + 1) * solver.block_s:.3f} s: this rig cannot be stepped "
        f"with solver.step_s = {solver.step_s:g}; shorten it, or weaken what is extreme"
    )
    return Fault("CONFIG", line)
