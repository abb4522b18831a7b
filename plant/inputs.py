"""Inputs of a rig block by block besides the command: the drive's velocity, noise, and the delays of commands."""

import math
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.arrays import Records
from bridge.wire.channels import CHANNELS
from bridge.wire.messages import ANNOUNCE
from plant.config import RigConfig
from plant.loop_delay import whole_blocks
from plant.simulate import held_velocity

_SAME_MPS = 1e-12  # velocities closer than this are equal: rounding of positions, 1e-17 m over a block
_JITTER = 1  # the second stream of the seed: jitter does not change the noise


class Inputs(NamedTuple):
    """The inputs of consecutive blocks."""

    velocity_mps: npt.NDArray[Any]  # velocity of the drive, [blocks]
    noise: npt.NDArray[np.float64]  # standard normal numbers, [blocks, 5, samples]
    delay_blocks: npt.NDArray[np.int64]  # delay of a command received before the block, [blocks]
    announcements: npt.NDArray[np.int64]  # number sent before the block's samples, [blocks]
    announce: Records  # these announcements, in order

    def joined(self, later: "Inputs") -> "Inputs":
        """These inputs, continued by the inputs of `later` blocks."""
        if not len(self.noise):
            return later
        announce = ANNOUNCE.blank(len(self.announce) + len(later.announce))
        announce[: len(self.announce)], announce[len(self.announce) :] = self.announce, later.announce
        joined: list[Any] = [np.concatenate(pair) for pair in zip(self[:-1], later[:-1], strict=True)]
        return Inputs._make([*joined, announce])

    def part(self, blocks: slice) -> "Inputs":
        """The blocks of a slice without a step."""
        first, last, _ = blocks.indices(len(self.noise))
        announced = slice(int(self.announcements[:first].sum()), int(self.announcements[:last].sum()))
        part: list[Any] = [numbers[blocks] for numbers in self[:-1]]
        return Inputs._make([*part, self.announce[announced]])


class RigInputs:
    """The drive's velocity, the sensors' noise and the delay of the commands, in order.

    Args:
        config: the rig file.
        seed: seed of noise and jitter; the numbers do not depend on how many blocks are drawn at once.

    """

    def __init__(self, config: RigConfig, seed: int) -> None:
        self._config = config
        self._velocity_mps = held_velocity(config)
        self._random = np.random.Generator(np.random.PCG64(seed))
        self._jitter = np.random.Generator(np.random.PCG64([seed, _JITTER]))
        self._block = 0
        self._ahead_blocks = whole_blocks(config.drive.announce_ahead_s, config.solver.block_s)
        self._announcements = 0
        self._announced_mps = math.nan

    def draw(self, blocks: int) -> Inputs:
        """The inputs of the next blocks."""
        noise = self._random.standard_normal((blocks, len(CHANNELS), self._config.solver.samples_per_block))
        t_s = (self._block + np.arange(blocks)) * self._config.solver.block_s
        self._block += blocks
        return Inputs(self._velocity_mps(t_s), noise, self._delay_blocks(blocks), *self._announce(blocks))

    def _announce(self, blocks: int) -> tuple[npt.NDArray[np.int64], Records]:
        """Number of announcements per drawn block, and the announcements.

        The samples of block n leave when block n + 1 begins: before them the rig announces the velocity of block n + 1 + ahead
        if it differs from the last announcement; before the samples of block 0, also the velocities of all blocks before it.
        """
        counts = np.zeros(blocks, np.int64)
        if not (self._ahead_blocks and blocks):
            return counts, ANNOUNCE.blank(0)
        solver = self._config.solver
        rows: list[tuple[int, int, float]] = []
        first = self._block - blocks
        ahead = np.arange(1 if first == 0 else first + 1 + self._ahead_blocks, self._block + 1 + self._ahead_blocks)
        for block, velocity_mps in zip(
            ahead.tolist(), self._velocity_mps(ahead * solver.block_s).tolist(), strict=True
        ):
            if not abs(velocity_mps - self._announced_mps) <= _SAME_MPS:
                at = max(block - 1 - self._ahead_blocks, 0)
                counts[at - first] += 1
                rows.append((at, block, velocity_mps))
                self._announced_mps = velocity_mps
        block_ns = round(solver.block_s * 1e9)
        announce = ANNOUNCE.blank(len(rows))
        for record, (at, block, velocity_mps) in zip(announce, rows, strict=True):
            record.sequence, record.t_ns = self._announcements, (at + 1) * block_ns
            record.holds_from_ns, record.drive_velocity_mps = block * block_ns, velocity_mps
            self._announcements += 1
        return counts, announce

    def _delay_blocks(self, blocks: int) -> npt.NDArray[Any]:
        loop, block_s = self._config.loop, self._config.solver.block_s
        if loop.jitter_s == 0.0:
            return np.full(blocks, whole_blocks(loop.delay_s, block_s))
        late_s = loop.delay_s + loop.jitter_s * self._jitter.random(blocks)
        return np.array([whole_blocks(delay_s, block_s) for delay_s in late_s], np.int64)


class InputsAhead:
    """The numbers of `RigInputs`, drawn ahead by a second thread: drawing takes a sixth of a run's time.

    Args:
        inputs: the source; nothing else may draw from it.

    """

    def __init__(self, inputs: RigInputs) -> None:
        self._inputs = inputs
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="inputs")
        self._ahead: Future[Inputs] | None = None

    def draw(self, blocks: int) -> Inputs:
        """The inputs of the next blocks; the thread begins to draw as many following blocks."""
        ahead = self._inputs.draw(blocks) if self._ahead is None else self._ahead.result()
        if (missing := blocks - len(ahead.noise)) > 0:
            ahead = ahead.joined(self._inputs.draw(missing))
        self._ahead = self._thread.submit(self._more, ahead.part(slice(blocks, None)), blocks)
        return ahead.part(slice(blocks))

    def _more(self, rest: Inputs, blocks: int) -> Inputs:
        return rest.joined(self._inputs.draw(max(blocks - len(rest.noise), 0)))
