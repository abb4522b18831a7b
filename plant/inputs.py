"""What comes into a rig block by block besides the command: the drive's velocity and the noise of the sensors."""

from typing import Any

import numpy as np
import numpy.typing as npt

from bridge.wire.messages import CHANNELS
from plant.config import RigConfig
from plant.simulate import drive_velocity_mps


class RigInputs:
    """The drive's velocity and the sensors' noise, in order.

    Args:
        config: the rig file.
        seed: of the noise; the same seed gives the same numbers, however many blocks are drawn at once.

    """

    def __init__(self, config: RigConfig, seed: int) -> None:
        self._config = config
        self._random = np.random.Generator(np.random.PCG64(seed))
        self._block = 0

    def draw(self, blocks: int) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
        """Of the next blocks: velocity [m/s], [blocks]; standard normal numbers, [blocks, 5, samples]."""
        noise = self._random.standard_normal((blocks, len(CHANNELS), self._config.solver.samples_per_block))
        t_s = (self._block + np.arange(blocks)) * self._config.solver.block_s
        self._block += blocks
        return drive_velocity_mps(self._config, t_s), noise
