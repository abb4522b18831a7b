"""The measured rate of a device against the computer's clock."""

_FROM_S = 10.0  # measured time: blocks arrive up to 1 ms early or late, 1e-4 of it
# Deviation of the rate that is a problem. Smaller: the crystal of a cheap converter, 1e-4. Larger: an equal error of v_d is not
# reported.
_FAR = 2e-3


class RateWatch:
    """Measures the rate of a device from its first block on, and reports it once.

    Args:
        rate_Hz: stated rate of the samples.
        samples_per_block: of the device.

    """

    def __init__(self, rate_Hz: float, samples_per_block: int) -> None:
        self._stated_Hz, self._samples = rate_Hz, samples_per_block
        self._begun_s: float | None = None
        self._blocks = 0
        self.rate_Hz = 0.0  # 0 before 10 s

    def add(self, blocks: int, now_s: float) -> tuple[str, str] | None:
        """Add blocks that arrived by `now_s` [s]; after 10 s, once, the code and text of the measured rate."""
        if self._begun_s is None:
            self._begun_s = now_s
            return None
        self._blocks += blocks
        since_s = now_s - self._begun_s
        if since_s < _FROM_S:
            return None
        is_first = self.rate_Hz == 0.0
        self.rate_Hz = self._blocks * self._samples / since_s
        return self._report() if is_first else None

    def _report(self) -> tuple[str, str]:
        ratio = self.rate_Hz / self._stated_Hz
        text = f"{self.rate_Hz:.1f} samples a second by the computer's clock, {ratio:.5f} times the rig file's rate"
        if abs(ratio - 1.0) < _FAR:
            return "DEVICE_CLOCK", text
        return "DEVICE_RATE", f"{text}: v_d and every frequency are wrong by this factor"
