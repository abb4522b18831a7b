"""Sticks, slips and surges of the true motion, sample by sample. The definitions and their reasons: docs/method/bank.md."""

import math

import numpy as np
import numpy.typing as npt

from bench.control.record import BINS, RING, SLIPPED, STUCK, SURGED
from bridge.kernel import Record, kernel
from bridge.wire.stickslip_pb2 import EXCITE

_STICKS, _SLIDES = 0.1, 0.5  # sliding velocity over v_d: below the first a stick begins, above the second it ends
_SETTLED = 1.1  # v_s over the recent largest v_d below which a slip or surge has ended
_SLOWING, _FASTER = 0.9, 1.2  # v_d over its recent largest: below, it slows down; v_s over `late_mps`: above, it slips
_LEAST_STICK_S = 2e-3  # shortest stick; shorter on a stiff axis, whose natural sticks are short
_REST_S = 0.02  # time without drag after which a stick has ended because the drive rests
_AFTERWARDS_S = 0.05  # time after a stick's end in which fast motion is the stick's slip
_NO_EVENT, _SLIP, _SURGE, _SWING = range(4)  # _SWING: the slide's motion after an event; not counted


@kernel
def put(
    events: npt.NDArray[np.float64], count: int, kind: int, a: float, b: float, c: float, d: float, e: float, f: float
) -> int:
    """Write an event; return the number of events. Beyond the last row, the last row is overwritten."""
    row = events[min(count, events.shape[0] - 1)]
    row[0], row[1], row[2], row[3], row[4], row[5], row[6] = kind, a, b, c, d, e, f
    return count + 1


@kernel
def put_stick(s: Record, events: npt.NDArray[np.float64], count: int) -> int:
    """Write the stick that has ended."""
    s.pending = 0
    return put(events, count, STUCK, s.stick_s, s.end_s, s.stick_mps, s.needs_s, s.announced_s, s.under_excite)


@kernel
def natural_stick_s(p: Record, speed_mps: float) -> float:
    """Approximate duration of a stick of this rig without vibration [s]."""
    return 2.0 * p.swing_N / (p.k_d * max(speed_mps, p.moves_mps))


@kernel
def _mean_mps(ring: Record, newest: int, whole: int, part: float, per_s: float) -> float:
    """Mean velocity over the last `whole + part` samples of a ring of positions."""
    a, b = (newest - whole) % RING, (newest - whole - 1) % RING
    return (ring[newest] - ring[a] + part * (ring[a] - ring[b])) * per_s


@kernel
def follow(
    p: Record,
    s: Record,
    x_m: float,
    bristle_m: float,
    drive_m: float,
    whole_periods_s: float,
    v_a_mps: float,
    events: npt.NDArray[np.float64],
    count: int,
) -> int:
    """Take one sample of the truth; return the number of events.

    Args:
        p, s: records of `bench.control.record`.
        x_m, bristle_m, drive_m: position of the slide, deflection of the bristles, position of the drive.
        whole_periods_s: the shortest window that holds whole periods of the exciter.
        v_a_mps: true v_a of the base.
        events, count: where events are written, and their number.

    """
    newest = s.at
    before_m = s.drive_m[(newest - 1) % RING]
    s.x_m[newest], s.slid_m[newest], s.drive_m[newest] = x_m, x_m - bristle_m, drive_m
    s.at = (newest + 1) % RING
    s.count += 1
    s.now_s = s.count * p.sample_s
    if s.count < 3:
        return count
    # at a creep feed the window is as long as the contact deflects elastically before it slides
    s.drive_now_mps = math.fabs(drive_m - before_m) / p.sample_s
    give_s = p.breakaway_m / max(s.drive_now_mps, p.moves_mps)
    window_s = whole_periods_s * max(math.ceil(give_s / whole_periods_s), 1.0)
    length = min(window_s / p.sample_s, RING - 2.0, s.count - 2.0)
    whole = int(length)
    part, per_s = length - whole, 1.0 / (length * p.sample_s)
    u = _mean_mps(s.drive_m, newest, whole, part, per_s)
    count = _drive(p, s, u, events, count)
    s.v_mps = s.dir * _mean_mps(s.x_m, newest, whole, part, per_s)
    sliding_mps = s.dir * _mean_mps(s.slid_m, newest, whole, part, per_s)
    count = _stick(p, s, sliding_mps, length * p.sample_s, newest, events, count)
    return _fast(p, s, v_a_mps, events, count)


@kernel
def _drive(p: Record, s: Record, u_mps: float, events: npt.NDArray[np.float64], count: int) -> int:
    """Update direction and speed of the drive, and its largest speed within a natural period of the slide."""
    s.speed_mps = math.fabs(u_mps)
    was_moving = s.moving
    s.moving = 1 if s.speed_mps > p.moves_mps else 0
    if s.moving == 1:
        direction = 1.0 if u_mps > 0.0 else -1.0
        if direction != s.dir:  # after a reversal a stick is a new one and needs a new announcement
            if s.stuck == 1:
                s.end_s = s.now_s
                count = put_stick(s, events, count)
            s.stuck, s.low_s = 0, 0.0
            s.dir, s.began_s = direction, s.now_s
        elif was_moving == 0 and s.now_s - s.stopped_s > 0.0:
            s.began_s = s.now_s
    else:
        s.stopped_s = s.now_s
    s.bin_s += p.sample_s
    if s.bin_s > p.hold_s / (BINS - 1):
        s.bin_s = 0.0
        s.bin = (s.bin + 1) % BINS
        s.fastest_mps[s.bin] = 0.0
    s.fastest_mps[s.bin] = max(s.fastest_mps[s.bin], s.speed_mps)
    s.fastest = p.floor_mps
    for i in range(BINS):
        s.fastest = max(s.fastest, s.fastest_mps[i])
    return count


@kernel
def _stick(
    p: Record, s: Record, sliding_mps: float, window_s: float, newest: int, events: npt.NDArray[np.float64], count: int
) -> int:
    """Detect begin and end of sticks, by the sliding velocity: v_s minus the rate of the bristles' deflection."""
    # at the end of a stroke, a drive below the motion threshold still drags its slide
    if s.speed_mps > 0.0 and sliding_mps < _SLIDES * s.speed_mps:
        s.dragged_s = s.now_s
    s.low_s = s.low_s + p.sample_s if s.moving == 1 and sliding_mps < _STICKS * s.speed_mps else 0.0
    if s.stuck == 0:
        natural_s = natural_stick_s(p, s.speed_mps)
        least_s = max(0.005 * natural_s, min(_LEAST_STICK_S, max(0.25 * natural_s, 0.25 * _LEAST_STICK_S)))
        if s.low_s >= (least_s if p.swing_N > 0.0 else _LEAST_STICK_S):
            if s.pending == 1:
                count = put_stick(s, events, count)
            s.stuck = 1
            s.stick_s = max(s.now_s - s.low_s - 0.5 * window_s, 0.0)
            back = min(round((s.now_s - s.stick_s) / p.sample_s), s.count - 1, RING - 1)
            s.stick_from_m = s.drive_m[(newest - back) % RING]
            s.stick_mps, s.needs_s, s.announced_s = 0.0, -1.0, -1.0
            s.under_excite = 1 if s.mode == EXCITE and s.excite_begin_s <= s.stick_s else 0
    elif sliding_mps > _SLIDES * max(s.speed_mps, p.floor_mps) or (s.moving == 0 and s.now_s - s.dragged_s > _REST_S):
        s.stuck, s.pending, s.end_s = 0, 1, s.now_s
        if s.moving == 1:
            s.released_s = s.now_s
    if s.stuck == 1:
        s.stick_mps = max(s.stick_mps, s.speed_mps)
        way_m, since_s = s.drive_m[newest] - s.stick_from_m, s.now_s - s.stick_s
        if s.needs_s < 0.0 and way_m * way_m * since_s >= p.seen_m2s:
            # time that 5 sigma need from the stick's begin, at the mean speed since then
            mean_mps = math.fabs(way_m) / since_s
            s.needs_s = (p.seen_m2s / (mean_mps * mean_mps)) ** (1.0 / 3.0) + 2.0 * p.block_s
    return count


@kernel
def _fast(p: Record, s: Record, v_a_mps: float, events: npt.NDArray[np.float64], count: int) -> int:
    """Detect slips, which follow a stick, and surges, which do not."""
    # a slide that slows down later than its drive is faster than v_d, but becomes no faster: not a slip
    if s.v_mps < p.slip_ratio * max(s.speed_mps, p.floor_mps):
        s.late_mps = 0.0
    elif s.late_mps == 0.0:
        s.late_mps = s.v_mps if s.speed_mps < _SLOWING * s.fastest else p.floor_mps
    if s.event != _NO_EVENT:
        s.dragged_s = s.now_s  # a swinging slide is not in smooth motion
    if s.event == _NO_EVENT:
        if s.v_mps > p.slip_ratio * s.fastest and s.v_mps > _FASTER * s.late_mps:
            s.event_s, s.event_ratio, s.event_mode = s.now_s, v_a_mps / s.fastest, s.mode
            s.peak_ratio, s.peak_mps = 0.0, 0.0
            if s.stuck == 1 or s.now_s - s.released_s < max(p.natural_s, _AFTERWARDS_S):
                s.event = _SLIP
            else:
                s.event = _SURGE if s.now_s > s.quiet_s else _SWING
        return count
    s.peak_mps = max(s.peak_mps, s.v_mps)
    s.peak_ratio = max(s.peak_ratio, s.v_mps / s.fastest)
    if s.v_mps < _SETTLED * s.fastest:
        if s.event != _SWING:
            kind = SLIPPED if s.event == _SLIP else SURGED
            count = put(events, count, kind, s.event_s, s.now_s, s.peak_ratio, s.event_ratio, s.event_mode, s.peak_mps)
        s.quiet_s = s.now_s + p.natural_s
        s.event = _NO_EVENT
    return count
