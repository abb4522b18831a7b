"""Whether blocks come in time: when the command ramps down without them, and the events STALE, PAUSED and FRESH."""

from enum import Enum

Events = list[tuple[str, str]]  # codes and texts


class _State(Enum):
    FRESH = 0  # blocks come in time
    STALLED = 1  # this process stalled: blocks may wait for it, and the rig is silent only if one more is missing
    STALE = 2  # STALE was published


class Freshness:
    """Follows blocks and stalls, by any clock [s].

    Args:
        block_s: period of the blocks.
        stale_after_s: silence after which the command ramps down; as many blocks in time end it.

    """

    def __init__(self, block_s: float, stale_after_s: float) -> None:
        self.heard_s = self.due_s = 0.0  # last new block or end of a stall; next step without a block
        self._block_s, self._stale_after_s = block_s, stale_after_s
        self._state = _State.FRESH
        self._silent = False  # the last step had no block
        self._in_time = 0  # blocks in a row that were in time
        self._stalled_s = 0.0  # stalls of this process that are not published

    @property
    def is_fresh(self) -> bool:
        """Whether there was no silence and no stall since the last FRESH."""
        return self._state is _State.FRESH

    def heard(self, now_s: float, late: bool = False) -> Events:
        """Take a new block, or the start of the run; blocks that waited during a stall are `late`."""
        self.heard_s, self.due_s, self._silent = now_s, now_s + self._stale_after_s, False
        self._in_time = 0 if late else self._in_time + 1
        if self.is_fresh or self._in_time * self._block_s < self._stale_after_s:
            return []
        self._state = _State.FRESH
        return [*self.paused(), ("FRESH", f"blocks arrive again, {self._in_time} in time")]

    def stalled(self, seconds: float) -> None:
        """Note that this process stalled; published with FRESH, as the link may be down until then."""
        self._state, self._in_time = _State.STALLED, 0
        self._stalled_s += seconds

    def missing(self, now_s: float) -> tuple[int, Events]:
        """Take a block that is missing; returns the block periods by which the command ramps down, and events."""
        blocks = 1 if self._silent else round(self._stale_after_s / self._block_s)
        new = self._state is _State.FRESH or (self._state is _State.STALLED and self._silent)
        # the slew limit counts steps: one each block period ramps as fast as with blocks
        self._silent, self._in_time, self.due_s = True, 0, now_s + self._block_s
        if not new:
            return blocks, []
        self._state = _State.STALE
        return blocks, [("STALE", f"no block for {self._stale_after_s * 1e3:g} ms: ramping to zero")]

    def paused(self) -> Events:
        """The event for the stalls that are not published."""
        stalled_s, self._stalled_s = self._stalled_s, 0.0
        text = f"this controller stalled for {stalled_s:.2f} s; the rig had no command during that time"
        return [("PAUSED", text)] if stalled_s else []
