"""Age of the blocks when they are answered, over the least age: it grows if the computer, the link or the rig became slow.

Rig and controller have two clocks. Their drift is removed, and with it a delay that lasts for minutes.
"""

MARGIN_NS = 15_000_000  # largest additional delay of the loop: v_a then stays within 4 %
HOLD_NS = 200_000_000  # time for which blocks are older until LATE is published; a single stall is shorter
_DRIFT = 2e-4  # largest relative drift of two clocks


class Age:
    """Tracks the age of blocks."""

    def __init__(self) -> None:
        self.late_ns = 0  # age of the last block minus the least age
        self._youngest_ns = 0.0
        self._last_ns: int | None = None
        self._since_ns: int | None = None

    @property
    def is_late(self) -> bool:
        """Whether every block of the last HOLD_NS was older than the margin."""
        return self._since_ns is not None and self._last_ns is not None and self._last_ns - self._since_ns >= HOLD_NS

    def note(self, answered_ns: int, t_ns: int) -> None:
        """Process a block: the time of the answer by the controller's clock, and the block's time by the rig's clock."""
        if answered_ns <= 0:  # a run in one process has no clock
            return
        age_ns = float(answered_ns - t_ns)
        if self._last_ns is None:
            self._youngest_ns = age_ns
        else:
            self._youngest_ns = min(age_ns, self._youngest_ns + _DRIFT * (answered_ns - self._last_ns))
        self._last_ns = answered_ns
        self.late_ns = round(age_ns - self._youngest_ns)
        if self.late_ns <= MARGIN_NS:
            self._since_ns = None
        elif self._since_ns is None:
            self._since_ns = answered_ns

    def forget(self) -> None:
        """Start again after a jump or restart of the rig's clock."""
        self._last_ns = self._since_ns = None
