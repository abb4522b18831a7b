"""How many messages of one topic are missing, whatever the order in which the others came."""

import numpy as np

from bridge.log.watches.arrays import Integers
from bridge.wire.messages import Records

# Missing numbers that are remembered, to see a message that comes later: a minute of blocks. More costs memory, 100 bytes each;
# of a longer gap a message that comes later counts as missing all the same.
_REMEMBERED = 1 << 16


class LossWatch:
    """Counts the numbers between the lowest and the highest that no message has, each once."""

    def __init__(self) -> None:
        self.first = self.end = 0  # the lowest number, and the one after the highest
        self._missing: set[int] = set()
        self._for_good = 0

    @property
    def missing(self) -> int:
        """How many numbers no message has."""
        return len(self._missing) + self._for_good

    def add(self, records: Records) -> None:
        """Take messages, [messages]."""
        if not len(records):
            return
        numbers = records["sequence"].astype(np.int64)
        if not (np.diff(numbers) > 0).all():
            numbers = np.sort(numbers, kind="stable")
            numbers = numbers[np.concatenate([[True], np.diff(numbers) > 0])]
        low, high = int(numbers[0]), int(numbers[-1]) + 1
        if self.end == self.first:
            self.first = self.end = low
        if low == self.end and high - low == len(numbers):
            self.end = high
            return
        self._fill(numbers[(numbers >= self.first) & (numbers < self.end)])
        below, above = numbers[numbers < self.first], numbers[numbers >= self.end]
        if len(below):
            self._gaps(np.append(below, self.first))
            self.first = low
        if len(above):
            self._gaps(np.concatenate([[self.end - 1], above]))
            self.end = high

    def _fill(self, numbers: Integers) -> None:
        if self._missing:
            self._missing.difference_update(numbers.tolist())

    def _gaps(self, numbers: Integers) -> None:
        for at in np.flatnonzero(np.diff(numbers) > 1):
            gap = range(int(numbers[at]) + 1, int(numbers[at + 1]))
            if len(self._missing) + len(gap) <= _REMEMBERED:
                self._missing.update(gap)
            else:
                self._for_good += len(gap)
