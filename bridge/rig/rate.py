"""The measured rate of a device against the computer's clock."""

_FROM_S = 10.0  # shortest measured time: blocks arrive up to 1 ms early or late, 1e-4 of it
# Deviation of the rate that is reported. Smaller: the crystal of a cheap converter, 1e-4. Larger: an error of v_d, equally large,
# is not reported.
_FAR = 2e-3


class RateWatch:
    """Counts the blocks of a device; `ratio` is its measured rate over the stated rate, 0 before 10 s.

    Args:
        block_s: stated length of a block.

    """

    def __init__(self, block_s: float) -> None:
        self._block_s = block_s
        self._begun_s: float | None = None
        self._blocks = 0
        self._reported = False
        self.ratio = 0.0

    def add(self, blocks: int, now_s: float) -> str:
        """Add blocks that arrived by `now_s` [s]; returns a text for the operator, once, if the rate is far off, else nothing."""
        if self._begun_s is None:
            self._begun_s = now_s
            return ""
        self._blocks += blocks
        since_s = now_s - self._begun_s
        if since_s < _FROM_S:
            return ""
        self.ratio = self._blocks * self._block_s / since_s
        if self._reported or abs(self.ratio - 1.0) < _FAR:
            return ""
        self._reported = True
        text = f"the device makes {self.ratio:.4f} times the samples that the rig file states, by the computer's clock"
        return f"{text}: v_d and every frequency are wrong by this factor"
