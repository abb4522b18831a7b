"""Values of each slip and of each stick before it: breakaway force, re-stick force, dwell, slope, speed of the drive."""

import math
from typing import NamedTuple

import numpy as np

from bridge.arrays import Floats
from diagnosis.look.creep import Climb, climb_of, fitted
from diagnosis.look.slips import OneWayPart, RecordSlips, find_slips, parts_of, smoothed

# Begin and end of the part of a stick in which its slope is measured: a re-stick rings, and before a breakaway the slide creeps.
_FROM, _TO = 0.25, 0.9
_FEWEST = 5  # fewest samples of that part
_EVEN = 0.5  # smallest way of the drive in that part, as a share of the way of an even drive
_LEVELS = (0.5, 0.6, 0.7, 0.8, 0.9)  # levels of the climb between which its rate is measured
# Smallest speed of a drive in a stick, over the mean speed around the stick. A drive has 1; a slide has 0, or a few hundredths
# where its contact gives way.
_LEAST_OF_DRIVE = 0.5
_ENOUGH = 1 << 20  # samples that are searched: a hundred slips of a slow rig at 10 kHz
_HALVES = 4  # from this width of the smoothing [samples] on, half of the samples locates a peak and half measures it


class Cycle(NamedTuple):
    """One slip and the stick before it; NaN where the record does not show it."""

    breakaway_t_s: float
    breakaway_force_N: float
    restick_t_s: float = math.nan
    restick_force_N: float = math.nan
    period_s: float = math.nan  # time since the breakaway before
    dwell_s: float = math.nan  # duration of the stick before the slip
    slope_N_per_s: float = math.nan  # slope of the force in that stick
    loading_N_per_s: float = math.nan  # largest slope in the last half of the stick, without halts of the drive
    speed_mps: float = math.nan  # speed of the drive in that stick
    stiffness_N_per_m: float = math.nan  # slope over the way of the drive: drive and contact in series
    drive_m_per_N: float = math.nan  # compliance of the drive in that stick
    contact_m_per_N: float = math.nan  # compliance of the contact, before it nears its breakaway
    mean_force_N: float = math.nan  # mean from this breakaway to the next
    sign: float = 1.0  # sign of the measured force


def cycles_of(slips: RecordSlips, speed_mps: float | None, limit: float = 1.0) -> list[Cycle]:
    """Values of every slip of a part.

    Args:
        slips: the slips of the part.
        speed_mps: the drive's speed, used where its position was not measured.
        limit: limit of the friction over the force at breakaway, see `creep`.

    """
    part = slips.part
    top_N, bottom_N = _peaks(slips)
    tops, bottoms = slips.tops.tolist(), slips.bottoms.tolist()
    cycles: list[Cycle] = []
    for i, top in enumerate(tops):
        known: dict[str, float] = {}
        if i:
            began = bottoms[i - 1]
            known = _stick(part, began, top, limit * float(top_N[i]), speed_mps, slips.width)
            known["period_s"] = float(part.t_s[top] - part.t_s[tops[i - 1]])
            known["dwell_s"] = float(part.t_s[top] - part.t_s[began])
            known["loading_N_per_s"] = _loading(part, began, top, slips.width)
        if i < len(bottoms):
            known |= {"restick_t_s": float(part.t_s[bottoms[i]]), "restick_force_N": float(bottom_N[i])}
        if i + 1 < len(tops):
            known["mean_force_N"] = float(part.force_N[top : tops[i + 1]].mean())
        cycles.append(Cycle(float(part.t_s[top]), float(top_N[i]), sign=part.sign, **known))
    return cycles


def climbs_of(slips: RecordSlips) -> list[tuple[Climb, float]]:
    """The middle of each stick of a part, with the force at its breakaway [N]; without sticks that are too short."""
    part, tops = slips.part, slips.tops[1:].tolist()
    climbs: list[tuple[Climb, float]] = []
    for began, top, top_N in zip(slips.bottoms.tolist(), tops, _peaks(slips)[0][1:].tolist(), strict=False):
        stuck = _stuck(began, top, slips.width)
        if (climb := climb_of(part.t_s[stuck], part.force_N[stuck])) is not None:
            climbs.append((climb, top_N))
    return climbs


def _stuck(began: int, top: int, width: int) -> slice:
    """The samples of a stick in which its shape is measured: the smoothing locates a breakaway to its `width`."""
    first = began + int(_FROM * (top - began))
    return slice(first, max(min(began + int(_TO * (top - began)), top - width), first))


def is_of_slide(t_s: Floats, force_N: Floats, position_m: Floats) -> bool:
    """Whether a position belongs to the slide, which rests in the sticks while the drive moves; [samples] each, SI units.

    False where no stick has a known speed.
    """
    few = slice(_ENOUGH)
    shares: list[float] = []
    for part in parts_of(t_s[few], force_N[few], position_m[few]):
        slips = find_slips(part)
        if slips is None or not slips.sticks or part.position_m is None:
            continue
        tops = slips.tops.tolist()
        for first, last, cycle in zip(tops[:-1], tops[1:], cycles_of(slips, None)[1:], strict=True):
            mean_mps = float(part.position_m[last] - part.position_m[first]) / ((last - first) * part.step_s)
            if mean_mps > 0.0 and np.isfinite(cycle.speed_mps):
                shares.append(cycle.speed_mps / mean_mps)
    return bool(shares) and float(np.median(shares)) < _LEAST_OF_DRIVE


def _peaks(slips: RecordSlips) -> list[Floats]:
    """Forces at breakaways and at re-sticks, [slips] each.

    The largest of several noisy samples is too large. So one half of the samples locates the peak, the other half measures it.
    """
    force_N, noise_N, width = slips.part.force_N, slips.part.noise_N, slips.width | 1
    if width < _HALVES or noise_N == 0.0:
        smooth = smoothed(force_N, min(width, 3) if noise_N > 0.0 else 1)
        courses, thinned, reach = [(smooth, smooth)], 1, max(width // 2, 1)
    else:
        halves = force_N[: len(force_N) // 2 * 2].reshape(-1, 2)
        even, odd = (smoothed(np.ascontiguousarray(halves[:, i]), width // 2) for i in (0, 1))
        courses, thinned, reach = [(even, odd), (odd, even)], 2, width
    result: list[Floats] = []
    for ends, sign in ((slips.tops, 1.0), (slips.bottoms, -1.0)):
        at = np.minimum(ends // thinned, len(courses[0][0]) - 1).tolist()
        near = [slice(max(i - reach, 0), i + reach + 1) for i in at]
        values = [
            [measuring[span][np.argmax(sign * locating[span])] for locating, measuring in courses] for span in near
        ]
        result.append(np.array(values).reshape(-1, len(courses)).mean(axis=1))
    return result


def _stick(
    part: OneWayPart, began: int, top: int, limit_N: float, speed_mps: float | None, width: int
) -> dict[str, float]:
    """Numbers of the middle of a stick by their names in `Cycle`: none of a short stick, the slope alone of an unknown speed."""
    first, last = began + int(_FROM * (top - began)), began + int(_TO * (top - began))
    if last - first < _FEWEST:
        return {}
    t_s, force_N = part.t_s[first:last], part.force_N[first:last]
    slope = _slope(t_s, force_N)
    if part.position_m is None:
        speed = speed_mps if speed_mps is not None else np.nan
    else:
        speed = _slope(t_s, part.position_m[first:last])
    known = {"slope_N_per_s": slope, "speed_mps": speed}
    if not speed > 0.0:
        return known
    if part.position_m is not None:
        in_part_m, in_stick_m = (part.position_m[b] - part.position_m[a] for a, b in ((first, last - 1), (began, top)))
        if in_part_m < _EVEN * (_TO - _FROM) * in_stick_m:  # the drive has halted
            return known
    known |= {"stiffness_N_per_m": slope / speed}
    stuck = _stuck(began, top, width)
    climb = climb_of(part.t_s[stuck], part.force_N[stuck])
    if climb is None or not limit_N > 0.0:
        return known
    fit = fitted(climb, speed, np.array([limit_N]))
    return known | {"drive_m_per_N": float(fit.drive_m_per_N[0]), "contact_m_per_N": float(fit.contact_m_per_N[0])}


def _loading(part: OneWayPart, began: int, top: int, width: int) -> float:
    """Largest rate of the force between levels in the last half of a stick [N/s]. NaN for too few samples."""
    climb = smoothed(part.force_N[began : top + 1], width)
    if len(climb) < _FEWEST:
        return np.nan
    levels = climb[0] + np.array(_LEVELS) * (climb[-1] - climb[0])
    # searched from the top back, as noise crosses a level several times
    reached = np.array([len(climb) - 1 - np.argmax(climb[::-1] <= level) for level in levels])
    quickest = float(np.diff(reached).min()) * part.step_s
    return float(levels[1] - levels[0]) / quickest if quickest > 0.0 else np.nan


def _slope(x: Floats, y: Floats) -> float:
    centred = x - x.mean()
    return float(centred @ (y - y.mean())) / float(centred @ centred)
