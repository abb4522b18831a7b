"""The time after a stall of the computer or the link, in which v_a does not correspond to the command.

The rig had no command during the stall and ramped to zero, while the controller continued to command. The late blocks are valid:
time, positions, force and slips count. But comparing v_a with the command gives no information on exciter and accelerometer: no
gain is learnt, the piezo is not weak, no swing changes the ratio, and no signal is doubted until that time is over.
"""

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory, ControllerParams
from bridge.wire.messages import LATE, STALE
from controller.trips.age import MARGIN_NS

# Time without a stall until v_a is compared with the command again. Shorter: false doubts after a stall (in runs of sound rigs
# with 0 s, not from 0.125 s on). Longer: with frequent stalls no time is left to compare, which caused false PIEZO_WEAK and
# OPEN_LOOP from 0.5 s on, and an accelerometer that fails during a stall is reported later by this time.
SETTLED_S = 0.15
# Longest time without a comparison. With stalls every 0.4 s a dead accelerometer is reported after this time; a shorter time
# doubts a sound rig sooner. The guard of the rig does not wait for it.
MOST_S = 3.0


@kernel
def note_stall(p: ControllerParams, s: ControllerMemory, events: int, gap_blocks: int) -> None:
    """Track stalls: late blocks, missing blocks, and lost blocks for longer than the margin of a late block."""
    if events & (STALE | LATE) or gap_blocks * p.block_s > 1e-9 * MARGIN_NS:
        s.quiet_s = 0.0
    else:
        s.quiet_s += p.block_s
    s.stalling_s = s.stalling_s + p.block_s if s.quiet_s < SETTLED_S else 0.0


@kernel
def is_judged(s: ControllerMemory) -> bool:
    """Whether v_a of a block may be compared with the command."""
    return s.stalling_s == 0.0 or s.stalling_s > MOST_S
