"""Whether blocks arrive in time: when the command ramps down without them, and the events STALE, PAUSED and FRESH."""

from enum import Enum

Events = list[tuple[str, str]]  # codes and texts


class _State(Enum):
    FRESH = 0  # blocks arrive in time
    STALLED = 1  # this process stalled: blocks may be queued, and the rig is silent only if a further block is missing
    STALE = 2  # STALE was published


class Freshness:
    """Tracks blocks and stalls, by any clock [s].

    Args:
        block_s: period of the blocks.
        stale_after_s: silence after which the command ramps down; blocks in time for as long end the silence.

    """

    def __init__(self, block_s: float, stale_after_s: float) -> None:
        self.heard_s = self.due_s = 0.0  # last new block or end of a stall; time of the next step without a block
        self._block_s, self._stale_after_s = block_s, stale_after_s
        self._state = _State.FRESH
        self._silent = False  # whether the last step of the controller was made without a block
        self._in_time = 0  # number of successive blocks in time
        self._stalled_s = 0.0  # total stall of this process that is not published yet

    @property
    def is_fresh(self) -> bool:
        """Whether there was no silence and no stall since the last FRESH."""
        return self._state is _State.FRESH

    def heard(self, now_s: float, late: bool = False) -> Events:
        """Process a new block, or the start of the run; blocks that were queued during a stall are `late`."""
        self.heard_s, self.due_s, self._silent = now_s, now_s + self._stale_after_s, False
        self._in_time = 0 if late else self._in_time + 1
        if self.is_fresh or self._in_time * self._block_s < self._stale_after_s:
            return []
        self._state = _State.FRESH
        return [*self.paused(), ("FRESH", f"blocks arrive again, {self._in_time} in time")]

    def stalled(self, seconds: float) -> None:
        """Store a stall of this process; it is published with FRESH, as the link may be down until then."""
        self._state, self._in_time = _State.STALLED, 0
        self._stalled_s += seconds

    def missing(self, now_s: float) -> tuple[int, Events]:
        """Process a missing block; return the block periods by which the command ramps down, and events."""
        blocks = 1 if self._silent else round(self._stale_after_s / self._block_s)
        new = self._state is _State.FRESH or (self._state is _State.STALLED and self._silent)
        # the slew limit counts steps: a step each block period ramps as fast as with blocks
        self._silent, self._in_time, self.due_s = True, 0, now_s + self._block_s
        if not new:
            return blocks, []
        self._state = _State.STALE
        return blocks, [("STALE", f"no block for {self._stale_after_s * 1e3:g} ms: ramping to zero")]

    def paused(self) -> Events:
        """The event for stalls that are not published yet."""
        stalled_s, self._stalled_s = self._stalled_s, 0.0
        text = f"this controller stalled for {stalled_s:.2f} s; the rig had no command during that time"
        return [("PAUSED", text)] if stalled_s else []
