"""The time after a stall of the computer or the link, in which what a block shows is not what was commanded before it.

Blocks that come late show a rig that had no command meanwhile, and ramped to zero by itself, while the controller commands as if
nothing had happened. They are true: time, positions, force and slips count. But v_a against the command says nothing of exciter
and accelerometer: no gain is learnt, no piezo is weak, no swing moves the ratio, and no signal is doubted until that is over.
"""

from bridge.kernel import Record, kernel
from controller.codes import LATE, STALE
from controller.trips.age import MARGIN_NS

# Time without a stall until v_a is compared with the command again. The value is that of the issue and was not swept.
# Shorter than that: PIEZO_WEAK of a sound piezo. Longer: a fault that begins with the stall is told later.
SETTLED_S = 1.0
# Longest time without a comparison. Shorter: three stalls in a row end in a false doubt. Longer: a link that stays late, or a
# computer that stalls every second, hides a dead accelerometer; the guard of the rig waits for none of this.
MOST_S = 3.0


@kernel
def note_stall(p: Record, s: Record, events: int, gap_blocks: int) -> None:
    """Follow stalls: blocks that are late, that do not come, or that are lost for as long as a late one is late."""
    if events & (STALE | LATE) or gap_blocks * p.block_s > 1e-9 * MARGIN_NS:
        s.quiet_s = 0.0
    else:
        s.quiet_s += p.block_s
    s.stalling_s = s.stalling_s + p.block_s if s.quiet_s < SETTLED_S else 0.0


@kernel
def is_judged(s: Record) -> bool:
    """Whether what a block shows may be compared with what was commanded."""
    return s.stalling_s == 0.0 or s.stalling_s > MOST_S
