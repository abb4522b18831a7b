"""The time after a stall of the computer or the link, in which v_a does not belong to the command.

The rig had no command during the stall and ramped to zero by itself, while the controller went on commanding. The late blocks are
true: time, positions, force and slips count. But v_a against the command is no evidence about exciter and accelerometer: no gain
is learnt, the piezo is not weak, no swing moves the ratio, and no signal is doubted until that time is over.
"""

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory, ControllerParams
from bridge.wire.messages import LATE, STALE
from controller.trips.age import MARGIN_NS

# Time without a stall until v_a is compared with the command again. Of eight runs of a sound rig, one stall of 0.05 to 1 s in
# each, five end in a false doubt with 0 s, none with 0.125 to 2 s. Of 18 runs of five scenarios with stalls of 0.1 s every 0.3,
# 0.6 or 0.9 s none ends in a false PIEZO_WEAK or OPEN_LOOP with 0.15 s, 4 with 0.5 s and 9 with 1 s, as a longer time leaves none
# to compare. An accelerometer that fails in a stall is reported 0.15, 0.5 and 1 s after it.
SETTLED_S = 0.15
# Longest time without a comparison. With stalls every 0.4 s a dead accelerometer is reported after 1.5, 2.9 and 5.8 s with 1.5, 3
# and 6 s, and a sound rig is doubted after 1.3, 2.5 and 5.3 s. The guard of the rig waits for none of this.
MOST_S = 3.0


@kernel
def note_stall(p: ControllerParams, s: ControllerMemory, events: int, gap_blocks: int) -> None:
    """Follow stalls: blocks that are late, that do not come, or that are lost for as long as a late one is late."""
    if events & (STALE | LATE) or gap_blocks * p.block_s > 1e-9 * MARGIN_NS:
        s.quiet_s = 0.0
    else:
        s.quiet_s += p.block_s
    s.stalling_s = s.stalling_s + p.block_s if s.quiet_s < SETTLED_S else 0.0


@kernel
def is_judged(s: ControllerMemory) -> bool:
    """Whether v_a of a block may be compared with the command."""
    return s.stalling_s == 0.0 or s.stalling_s > MOST_S
