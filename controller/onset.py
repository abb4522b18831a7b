"""The estimate of stick-slip's onset from force, acceleration and drive position.

While the contact sticks, the drive force climbs at k_d v_d; while the contact slides steadily, the force is constant. So the
force rate s = (dF_d/dt) / (k_d v_d) tells stick (1) from smooth sliding (0) about 20 ms after the re-stick, some 900 ms before
the slip. The acceleration only confirms: a fall of the force is a slip if the slide's acceleration, without the exciter's
lines, bursts as well.
"""

import math

from bridge.kernel import Record, kernel
from controller.codes import SLIP, SMOOTH, STANDSTILL, STICK, UNKNOWN
from controller.config import FEWEST_WINDOW_BLOCKS, LONGEST_WINDOW_BLOCKS

_SLIP_BLOCKS = 3  # blocks over which the force of a slip falls
# Share of the new value in the score's filter, a first-order filter of 5 blocks. Larger: noise moves the score. Smaller: stick is
# seen later.
_SCORE_SHARE = 0.2
# Share a block by which the held v_d falls, a time constant of 0.1 s. Larger: the vibration dips when the drive slows. Smaller:
# the vibration stays strong for longer than needed.
_HOLD_SHARE = 0.01
_SLOPE_OF_SLIP_END = -1.0  # slope of the force, over k_d v_d, above which the slip has ended


@kernel
def _slope(ring: Record, at: int, count: int, block_s: float) -> float:
    """Least-squares slope per second of the last `count` values of a ring whose newest is at - 1."""
    middle = 0.5 * (count - 1)
    total = 0.0
    for i in range(count):
        total += (i - middle) * ring[(at - count + i) % LONGEST_WINDOW_BLOCKS]
    return 12.0 * total / (block_s * count * (count * count - 1.0))


@kernel
def _filled(
    ring: Record, at: int, count: int, window_blocks: int, missing_blocks: int, value: float
) -> tuple[int, int]:
    """Fill the missing blocks of a ring evenly between its last value and `value`; return its next index and its count."""
    if count == 0 or 2 * missing_blocks >= window_blocks:
        return at, 0  # begin anew, as at least half of the window would be interpolated
    last = ring[(at - 1) % LONGEST_WINDOW_BLOCKS]
    for i in range(missing_blocks):
        ring[(at + i) % LONGEST_WINDOW_BLOCKS] = last + (value - last) * (i + 1.0) / (missing_blocks + 1.0)
    return (at + missing_blocks) % LONGEST_WINDOW_BLOCKS, min(count + missing_blocks, window_blocks)


@kernel
def fill_gap(p: Record, s: Record, missing_blocks: int, force_N: float, position_m: float) -> None:
    """Interpolate the lost blocks before this block, as the rings hold blocks one period apart.

    Emptied rings would need 20 blocks without a loss until v_d is measured again (docs/method/controller.md).
    """
    s.force_at, s.force_count = _filled(s.force_N, s.force_at, s.force_count, p.window_blocks, missing_blocks, force_N)
    s.position_at, s.position_count = _filled(
        s.position_m, s.position_at, s.position_count, p.velocity_window_blocks, missing_blocks, position_m
    )


@kernel
def drive_velocity(p: Record, s: Record, position_m: float) -> None:
    """Measure v_d from the drive position, the mean of the block [m]."""
    s.position_m[s.position_at] = position_m
    s.position_at = (s.position_at + 1) % LONGEST_WINDOW_BLOCKS
    s.position_count = min(s.position_count + 1, p.velocity_window_blocks)
    if s.position_count < p.velocity_window_blocks // 2:
        return
    s.drive_velocity_mps = _slope(s.position_m, s.position_at, s.position_count, p.block_s)
    held = s.drive_velocity_held_mps
    s.drive_velocity_held_mps = max(s.drive_velocity_mps, held + _HOLD_SHARE * (s.drive_velocity_mps - held), 0.0)


@kernel
def contact(p: Record, s: Record, force_N: float, burst_mps2: float) -> None:
    """Judge the contact from the force, the mean of the block [N], and the slide's burst, the rms of the block [m/s2]."""
    s.burst_mps2 = burst_mps2
    s.burst_held_mps2 = max(burst_mps2, 0.8 * s.burst_held_mps2)  # a burst acts for some 10 blocks
    s.force_N[s.force_at] = force_N
    s.force_at = (s.force_at + 1) % LONGEST_WINDOW_BLOCKS
    s.force_count = min(s.force_count + 1, p.window_blocks)
    s.time_to_slip_s = -1.0
    expected_N_per_s = p.drive_stiffness_N_per_m * s.drive_velocity_mps
    measured = s.position_count >= p.velocity_window_blocks // 2
    moving = measured and s.drive_velocity_mps > p.standstill_mps
    _count_slips(p, s, force_N, expected_N_per_s)
    if s.slipping == 1:
        s.contact = SLIP
        s.force_rate = _slope(s.force_N, s.force_at, min(s.force_count, _SLIP_BLOCKS + 1), p.block_s) / max(
            expected_N_per_s, p.drive_stiffness_N_per_m * p.standstill_mps
        )
        s.score = 1.0
        return
    if not moving or s.force_count < FEWEST_WINDOW_BLOCKS:
        s.contact = STANDSTILL if measured and not moving else UNKNOWN
        s.force_rate = 0.0
        s.score += _SCORE_SHARE * (0.0 - s.score)
        return
    slope_N_per_s = _slope(s.force_N, s.force_at, s.force_count, p.block_s)
    s.force_rate = slope_N_per_s / expected_N_per_s
    likely = min(max((s.force_rate - 0.5 * p.stick_force_rate) / p.stick_force_rate, 0.0), 1.0)
    s.score += _SCORE_SHARE * (likely - s.score)
    s.contact = STICK if s.force_rate > p.stick_force_rate else SMOOTH
    breakaway_N = known_breakaway_N(p, s)
    if s.contact == STICK and breakaway_N > 0.0:
        s.time_to_slip_s = max(breakaway_N - force_N, 0.0) / slope_N_per_s


@kernel
def known_breakaway_N(p: Record, s: Record) -> float:
    """The breakaway force, learnt or configured [N]; 0 while unknown."""
    return s.breakaway_N if s.breakaway_N > 0.0 else p.breakaway_force_N


@kernel
def _count_slips(p: Record, s: Record, force_N: float, expected_N_per_s: float) -> None:
    s.peak_N = max(s.peak_N, force_N)
    if s.force_count <= _SLIP_BLOCKS:
        return
    before_N = s.force_N[(s.force_at - 1 - _SLIP_BLOCKS) % LONGEST_WINDOW_BLOCKS]
    drop_N = before_N - force_N
    if s.slipping == 0:
        fast = drop_N > max(p.slip_drop_N, 4.0 * expected_N_per_s * _SLIP_BLOCKS * p.block_s)
        if fast and s.burst_held_mps2 > p.slip_burst_mps2:
            s.slipping = 1
            s.slips += 1
            if s.allowed_m == 0.0:  # a vibrated contact breaks away at a lower force
                s.breakaway_N = s.peak_N if s.breakaway_N == 0.0 else 0.7 * s.breakaway_N + 0.3 * s.peak_N
    elif drop_N < -_SLOPE_OF_SLIP_END * math.fabs(expected_N_per_s) * _SLIP_BLOCKS * p.block_s:
        s.slipping = 0
        s.peak_N = force_N
        s.force_count = 0  # the slope of the next stick must not contain the fall of the force
