"""Scope: samples at full rate around a slip, or around a manual trigger."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.arrays import Records
from bridge.wire.channels import CHANNELS

BEFORE_S, AFTER_S = 0.1, 0.1  # captured before and after the trigger; a slip takes a few ms
_AGAIN_S = 0.5  # least time between two captures; an operator cannot read more of them
BY_HAND = "by hand"
BY_SLIP = "a slip"


class Capture(NamedTuple):
    """Samples around one instant."""

    number: int  # number of this capture in its run, from 1
    cause: str  # BY_SLIP or BY_HAND
    t_s: float  # time of the run at the end of the triggering block
    before_s: float  # time from the first sample to `t_s`
    sample_s: float
    samples: npt.NDArray[np.float32]  # [channels, samples], SI units; nan where a block is missing
    missing: int  # blocks missing in `samples`


class Scope:
    """Captures samples around the slips that the controller counts in one run, with blocks of `block_ns`."""

    def __init__(self, block_ns: int) -> None:
        self._block_ns = block_ns
        self._before = max(1, round(BEFORE_S * 1e9 / block_ns))  # blocks
        self._after = max(1, round(AFTER_S * 1e9 / block_ns))
        self._again = max(1, round(_AGAIN_S * 1e9 / block_ns))
        self._blocks: list[Records] = []
        self._numbers = np.empty(0, np.int64)
        self._slips: int | None = None  # latest count of the controller
        self._pending: tuple[int, str] | None = None
        self._last = -(2**62)  # block of the last capture
        self._made = 0

    def add_blocks(self, table: Records, numbers: npt.NDArray[np.int64]) -> None:
        """Add blocks with their numbers, in order."""
        self._blocks.append(table)
        self._numbers = np.append(self._numbers, numbers)
        most = 2 * (self._before + self._after)
        while len(self._blocks) > 1 and len(self._numbers) - len(self._blocks[0]) >= most:
            self._numbers = self._numbers[len(self._blocks.pop(0)) :]

    def add_slips(self, slips: npt.NDArray[np.int64], numbers: npt.NDArray[np.int64]) -> None:
        """Add the controller's count of slips after each block."""
        if not len(slips):
            return
        rises = np.flatnonzero(np.diff(slips, prepend=slips[0] if self._slips is None else self._slips) > 0)
        self._slips = int(slips[-1])
        if len(rises):
            self._trigger(int(numbers[rises[0]]), BY_SLIP)

    def take_now(self) -> None:
        """Trigger at the newest block."""
        if len(self._numbers):
            self._trigger(int(self._numbers[-1]), BY_HAND)

    def _trigger(self, block: int, cause: str) -> None:
        if self._pending is None and block - self._last >= self._again:
            self._pending, self._last = (block, cause), block

    def ready(self) -> Capture | None:
        """The capture, once its last block has arrived; otherwise None."""
        if self._pending is None or not len(self._numbers) or self._numbers[-1] < self._pending[0] + self._after:
            return None
        (block, cause), self._pending = self._pending, None
        first, count = block - self._before + 1, self._before + self._after
        table = np.concatenate(self._blocks)
        inside = (self._numbers >= first) & (self._numbers < first + count)
        places = self._numbers[inside] - first
        samples = table[CHANNELS[0]].shape[1]
        made = np.full((len(CHANNELS), count, samples), np.nan, np.float32)
        for row, channel in enumerate(CHANNELS):
            made[row][places] = table[channel][inside]
        self._made += 1
        return Capture(
            number=self._made,
            cause=cause,
            t_s=(block + 1) * self._block_ns * 1e-9,
            before_s=(self._before - 1 / samples) * self._block_ns * 1e-9,
            sample_s=self._block_ns * 1e-9 / samples,
            samples=made.reshape(len(CHANNELS), -1),
            missing=count - len(np.unique(places)),
        )
