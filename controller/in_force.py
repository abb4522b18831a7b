"""The time in which the rig vibrates as commanded: only then does its motion give information on the vibration.

Without a fresh command the rig ramps to zero, the guard may hold a command back, and after a stall the blocks are late, while the
controller continues to command. Time, positions, force and slips of such blocks are valid. But nothing is learnt from them, no
trip starts, and no ratio changes, until the rig has followed the commands for a settling time.

Each block states the vibration in force. Blocks of schema 1 and 2 do not; then stalls of the computer and the link alone count.
"""

import math
from typing import Any

import numpy as np

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory, ControllerParams, SensorRow
from bridge.wire.messages import BLOCK, LATE, STALE
from bridge.wire.stickslip_pb2 import ACTIVE, ARMED, CHECKING, SLEW_RATE
from controller.trips.age import MARGIN_NS

REMEMBERED = 512  # number of stored commands, one a step: 0.1 s of blocks of 0.25 ms
# Time in force until v_a is compared with the command again. Shorter: false doubts after a stall (in runs of sound rigs with 0 s,
# not from 0.125 s on). Longer: with frequent stalls no time is left to compare, which caused false PIEZO_WEAK and OPEN_LOOP from
# 0.5 s on, and an accelerometer that fails during a stall is reported later by this time.
SETTLED_S = 0.15
# Longest time without a comparison because of stalls. With stalls every 0.4 s a dead accelerometer is reported after this time; a
# shorter time doubts a sound rig sooner. The guard of the rig does not wait for it.
MOST_S = 3.0
# Settling times of the spring after which the ratio changes again. The slide stops in an interruption and then runs ahead until
# the spring has settled, which looks like a swing of friction. Shorter: with 0, an exciter that delivers double for 80 ms of each
# second raised the ratio from 1.2 to 1.43; gaps in the commands did so on none of five axes. Longer: a swing is followed later.
_SPRING = 2.0
_SLOWEST_S = 5.0  # longest settling time of the spring that counts; slow feeds would hold the ratio for minutes
_SAME = 0.05  # largest difference of an applied amplitude from the command, over the command: a longer link changes v_a less


@kernel
def note_in_force(p: ControllerParams, s: ControllerMemory, events: int, gap_blocks: int, block: SensorRow) -> None:
    """Track how long the commands have been in force; `block` is not read when `events` has no BLOCK."""
    s.overruled = 0 if events & BLOCK == 0 or block.applied_Hz == 0.0 or _is_applied(s, block) else 1
    stalls = events & (STALE | LATE) != 0 or gap_blocks * p.block_s > 1e-9 * MARGIN_NS
    # the loop check drives the exciter while nothing is commanded, and ends at rest: a first vibration follows at once
    in_turn = s.overruled == 1 and s.guard_state != CHECKING
    s.quiet_s = 0.0 if stalls or in_turn else s.quiet_s + p.block_s
    s.stalling_s = s.stalling_s + p.block_s if s.quiet_s < SETTLED_S else 0.0
    loud = s.loud_steps != 0 or s.cut_steps > 0  # the exciter delivers far more than commanded, or did a loop delay ago
    s.settled_s = 0.0 if loud else min(s.settled_s, s.quiet_s) + p.block_s


@kernel
def _is_applied(s: ControllerMemory, block: SensorRow) -> bool:
    """Whether the amplitude that the rig applied is the amplitude of the command that it answers."""
    answered: Any = np.int64(block.applied_block)
    age = np.int64(block.sequence) - answered
    if answered == -1:  # NO_BLOCK: before the first command nothing vibrates, as at any normal start
        return block.applied_m == 0.0
    if block.fallback == 1 or not 0 < age < REMEMBERED:
        return False
    sent_m = s.sent_m[(s.steps - age) % REMEMBERED]
    if math.fabs(block.applied_m - sent_m) <= _SAME * sent_m:
        return True
    # at a normal start the exciter's slew holds v_a back for some ms; after an interruption the slew belongs to it
    return block.guard_limit == SLEW_RATE and block.guard_state in (ARMED, ACTIVE) and s.quiet_s >= SETTLED_S


@kernel
def is_judged(s: ControllerMemory) -> bool:
    """Whether v_a of a block may be compared with the command."""
    return s.overruled == 0 and (s.stalling_s == 0.0 or s.stalling_s > MOST_S)


@kernel
def is_settled(s: ControllerMemory, spring_s: float) -> bool:
    """Whether the slide has settled after the last interruption, for a settling time of its spring [s]: else no ratio rises."""
    return is_judged(s) and s.settled_s > max(SETTLED_S, _SPRING * min(spring_s, _SLOWEST_S))
