"""The rig as a participant of the bus: commands in, sensor blocks and the applied vibration out."""

import math

import numpy as np

from bridge.faults import Fault
from bridge.kernel_cache import compile_once
from bridge.wire.messages import ANNOUNCE as ANNOUNCE_LAYOUT
from bridge.wire.messages import APPLIED as APPLIED_LAYOUT
from bridge.wire.messages import CHANNELS, sensor_block
from bridge.wire.messages import COMMAND as COMMAND_LAYOUT
from bridge.wire.topics import ANNOUNCE, APPLIED, COMMAND, SENSORS, Outgoing
from plant.config import RigConfig
from plant.inputs import Inputs, RigInputs
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
        nothing = np.zeros(1, np.int64)
        self._drawn = Inputs(
            np.zeros(1), np.zeros((1, len(CHANNELS), samples)), nothing, nothing, ANNOUNCE_LAYOUT.blank(0)
        )
        self._announced = 0  # of the announcements drawn, those that went out
        self.announcements: list[Outgoing] = []  # of the last block, which go out before its samples
        self._command = COMMAND_LAYOUT.blank()
        self._sensors = sensor_block(samples).blank()
        self._applied = APPLIED_LAYOUT.blank()

    def warm_up(self) -> None:
        """Compile or load the kernel on copies, so that the first block is not late."""
        compile_once("the plant", self._step_copies)

    def _step_copies(self) -> None:
        step(
            self._params, self._state.copy(), 0.0, self._command, 0, 0, self._drawn.noise[0], 0, 0, 0,
            self._analogue, self.truth, sensor_block(self._drawn.noise.shape[2]).blank(), APPLIED_LAYOUT.blank(),
        )  # fmt: skip

    def advance(
        self, commands: list[bytes], commands_late: int = 0, round_trip_ns: int = 0, late_ns: int = 0
    ) -> tuple[Outgoing, Outgoing]:
        """Advance one block under the newest of `commands`; return the sensor block and the applied vibration.

        Send `announcements` before them.

        Raises Fault BAD_MESSAGE when the command cannot be read, CONFIG when the state becomes NaN or infinite, so that the
        rig cannot be stepped.
        """
        if commands:
            self._command = COMMAND_LAYOUT.read(commands[-1], COMMAND.name)
        at = self.block % _BATCH_BLOCKS
        if at == 0:
            self._drawn = self._inputs.draw(_BATCH_BLOCKS)
            self._announced = 0
        velocity_mps, noise, delay_blocks, announcements, announce = self._drawn
        first, self._announced = self._announced, self._announced + int(announcements[at])
        self.announcements = [
            Outgoing(ANNOUNCE, announce[row : row + 1].tobytes()) for row in range(first, self._announced)
        ]
        step(
            self._params, self._state, velocity_mps[at], self._command, len(commands), int(delay_blocks[at]), noise[at],
            commands_late, round_trip_ns, late_ns, self._analogue, self.truth, self._sensors, self._applied,
        )  # fmt: skip
        if not math.isfinite(self.truth[_VELOCITY, -1]):  # NaN anywhere in the state reaches the velocity within a step
            raise no_number(self._config, self.block)
        self.block += 1
        return Outgoing(SENSORS, self._sensors.tobytes()), Outgoing(APPLIED, self._applied.tobytes())

    def let_go(self) -> None:
        """Forget the commands in force and on their way, so that the vibration fades to zero at the piezo's own rate."""
        self._state["command_block"] = NO_COMMAND
        self._state["line_count"] = 0

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
