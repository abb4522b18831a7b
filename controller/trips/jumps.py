"""Jumps of the drive position: from one block to the next by far more than in the blocks before and after."""

import math

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory, ControllerParams
from bridge.wire.stickslip_pb2 import DRIVE_DOUBTED
from controller.estimate.windows import BINS, clear_windows
from controller.estimate.windows import DRIVE as DRIVE_ROW
from controller.trips.doubts import DRIVE, OF_DRIVE, trip

_FARTHER = 10.0  # smallest jump, over the changes of position in the blocks before and after it
_BENDS = 20.0  # smallest jump, over the noise: the mean second difference within a block
_ANOTHER = 0.3  # relative change of v_d at a jump from which the position has another unit
_SIGMAS = 3.0  # sigmas of the noise of v_d that are added to this limit
_STEPS = 4.0  # smallest jump, over the quantisation step of the position
HOLD_S = 0.1  # time for which v_d keeps its value from before a jump, while the windows refill
_MOST = 2.5  # count of jumps above which the drive position is doubted
FORGET_S = 1.0  # time constant of this count


@kernel
def watch_jumps(p: ControllerParams, s: ControllerMemory, place_m: float, blocks: int) -> None:
    """Process the first position of a block, `blocks` after the last block; judge whether the last but one change is a jump."""
    if s.jumped_s > 0.0:
        s.jumped_s = max(s.jumped_s - p.block_s, 0.0)
        if s.jumped_s == 0.0 and _is_another_speed(p, s):
            trip(s, DRIVE_DOUBTED, DRIVE)
    s.jumps *= 1.0 - min(p.block_s / FORGET_S, 1.0)
    went_m = math.fabs(place_m - s.first_sample[OF_DRIVE])
    if blocks != 1 or s.first_seen == 0 or s.bend_m == 0.0:
        s.went_m[:] = -1.0
        return
    before_m, middle_m = s.went_m[0], s.went_m[1]
    s.went_m[0], s.went_m[1] = middle_m, went_m
    floor_m = max(_BENDS * s.bend_m, _STEPS * s.resolution[DRIVE_ROW])
    if before_m < 0.0 or middle_m <= floor_m + _FARTHER * max(before_m, went_m):
        return
    s.jumped_s, s.shaken_s = HOLD_S, 0.0
    s.jumps += 1.0
    clear_windows(s)  # a window with a jump would raise the noise and soften the spring
    if s.jumps > _MOST:
        trip(s, DRIVE_DOUBTED, DRIVE)


@kernel
def _is_another_speed(p: ControllerParams, s: ControllerMemory) -> bool:
    """Whether the drive has another speed than before a jump."""
    level = max(s.spring_level, p.spring_level)
    if s.pushed[level] < BINS:
        return False
    before_mps, after_mps = s.kept_mps[DRIVE_ROW], s.slope[DRIVE_ROW, level]
    least_mps = _ANOTHER * math.fabs(before_mps) + _SIGMAS * s.noise[DRIVE_ROW, level]
    return math.fabs(after_mps - before_mps) > least_mps
