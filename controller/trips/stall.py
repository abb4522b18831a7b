"""The time after a stall of the computer or the link, in which v_a does not belong to the command.

The rig had no command during the stall and ramped to zero by itself, while the controller went on commanding. The late blocks are
true: time, positions, force and slips count. But v_a against the command is no evidence about exciter and accelerometer: no gain
is learnt, the piezo is not weak, no swing moves the ratio, and no signal is doubted until that time is over.
"""

from bridge.kernel import Record, kernel
from controller.codes import LATE, STALE
from controller.trips.age import MARGIN_NS

# Time without a stall until v_a is compared with the command again. Of eight runs of a sound rig, one stall of 0.05 to 1 s in
# each, five end in a false doubt with 0 s, none with 0.125 to 2 s. Longer: an accelerometer that fails in a stall is reported
# later by as much.
SETTLED_S = 1.0
# Longest time without a comparison; the guard of the rig waits for none of this. Longer: under stalls that leave no time to
# compare, a dead accelerometer is reported later by as much. Shorter: a sound rig is doubted sooner by as much.
MOST_S = 3.0
# Time without a stall that suffices once stalls have gone on for half of MOST_S. With 0 s a sound rig that stalls for 0.1 s every
# 0.8, 0.6 or 0.3 s is doubted after 3 s, with 0.15 s it is not. Longer: it is again, where stalls leave no time to compare.
_LEAST_S = 0.15


@kernel
def note_stall(p: Record, s: Record, events: int, gap_blocks: int) -> None:
    """Follow stalls: blocks that are late, that do not come, or that are lost for as long as a late one is late."""
    if events & (STALE | LATE) or gap_blocks * p.block_s > 1e-9 * MARGIN_NS:
        s.quiet_s = 0.0
    else:
        s.quiet_s += p.block_s
    if s.quiet_s >= SETTLED_S:
        s.stalling_s = 0.0
    else:
        compared = s.quiet_s > _LEAST_S and s.stalling_s > 0.5 * MOST_S
        s.stalling_s = 0.5 * MOST_S + p.block_s if compared else s.stalling_s + p.block_s


@kernel
def is_judged(s: Record) -> bool:
    """Whether v_a of a block may be compared with the command."""
    return s.stalling_s == 0.0 or s.stalling_s > MOST_S or (s.stalling_s > 0.5 * MOST_S and s.quiet_s > _LEAST_S)
