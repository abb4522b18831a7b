"""Whether blocks arrive in time: when the command ramps down without them, the events STALE, PAUSED and FRESH, and their age."""

import math

Events = list[tuple[str, str]]  # codes and texts
MARGIN_NS = 15_000_000  # largest additional delay of the loop: v_a then stays within 4 %
HOLD_NS = 200_000_000  # time for which blocks are older until LATE is published; a single stall is shorter
COMPUTERS = 2e-4  # largest relative drift of the clocks of two computers


class Freshness:
    """Tracks blocks and stalls, by any clock [s].

    Args:
        block_s: period of the blocks.
        stale_after_s: silence after which the command ramps down; blocks in time for as long end the silence.

    """

    def __init__(self, block_s: float, stale_after_s: float) -> None:
        self.heard_s = self.due_s = 0.0  # last new block or end of a stall; time of the next step without a block
        self.is_fresh = True  # no silence and no stall since the last FRESH
        self._block_s, self._stale_after_s = block_s, stale_after_s
        self._published = False  # whether STALE was published for this silence
        self._silent = False  # whether the last step of the controller was made without a block
        self._in_time = 0  # number of successive valid blocks in time
        self._stalled_s = 0.0  # total stall of this process that is not published yet

    def heard(self, now_s: float, in_time: bool = True) -> Events:
        """Process a new block, or the start of the run; a block that was queued during a stall is not `in_time`."""
        self.heard_s, self.due_s, self._silent = now_s, now_s + self._stale_after_s, False
        self._in_time = self._in_time + 1 if in_time else 0
        if self.is_fresh or self._in_time * self._block_s < self._stale_after_s:
            return []
        self.is_fresh, self._published = True, False
        return [*self.paused(), ("FRESH", f"blocks arrive again, {self._in_time} in time")]

    def stalled(self, seconds: float) -> None:
        """Store a stall of this process; it is published with FRESH, as the link may be down until then."""
        self.is_fresh = self._published = False
        self._in_time = 0
        self._stalled_s += seconds

    def missing(self, now_s: float) -> tuple[int, Events]:
        """Process a missing block; return the block periods by which the command ramps down, and events."""
        blocks = 1 if self._silent else round(self._stale_after_s / self._block_s)
        # after a stall blocks may be queued, so the rig is silent only if a further block is missing
        is_new = not self._published and (self._silent or self._stalled_s == 0.0)
        # the slew limit counts steps: a step each block period ramps as fast as with blocks
        self._silent, self._in_time, self.due_s = True, 0, now_s + self._block_s
        if not is_new:
            return blocks, []
        self.is_fresh, self._published = False, True
        return blocks, [("STALE", f"no block for {self._stale_after_s * 1e3:g} ms: ramping to zero")]

    def paused(self) -> Events:
        """The event for stalls that are not published yet."""
        stalled_s, self._stalled_s = self._stalled_s, 0.0
        text = f"this controller stalled for {stalled_s:.2f} s; the rig had no command during that time"
        return [("PAUSED", text)] if stalled_s else []


class Age:
    """Age of the blocks when they are answered, over the least age: it grows if the computer, the link or the rig became slow.

    Rig and controller have two clocks. Their drift is removed, and with it a delay that lasts for minutes.

    Args:
        drift: largest relative drift of the two clocks.

    """

    def __init__(self, drift: float = COMPUTERS) -> None:
        self.drift = drift
        self.late_ns = 0  # age of the last block minus the least age
        self.forget()

    def forget(self) -> None:
        """Start again after a jump or restart of the rig's clock."""
        self._youngest_ns = math.inf
        self._last_ns = self._since_ns = 0  # answers to the last block, and to the first late block in a row; 0: none

    def note(self, answered_ns: int, t_ns: int) -> None:
        """Process a block: the time of the answer by the controller's clock, and the block's time by the rig's clock."""
        drifted_ns = self._youngest_ns + self.drift * (answered_ns - self._last_ns)
        self._youngest_ns = min(float(answered_ns - t_ns), drifted_ns)
        self._last_ns, self.late_ns = answered_ns, round(answered_ns - t_ns - self._youngest_ns)
        if self.late_ns <= MARGIN_NS:
            self._since_ns = 0
        elif self._since_ns == 0:
            self._since_ns = answered_ns

    @property
    def is_late(self) -> bool:
        """Whether every block of the last HOLD_NS was older than the margin."""
        return self._since_ns > 0 and self._last_ns - self._since_ns >= HOLD_NS
