"""The slips of a run, in the force of its drive.

A slip is a fall of the force along the motion: of F where the drive goes forwards, of -F where it goes backwards. Where the drive
turns, the force changes its sign as fast as a slip on a stiff axis, so each stroke of the drive is looked at by itself.

The force falls as well where a soft drive rings, and where the drive stops and the slide comes after it. With the place of the
slide the two are told apart: a slide that slips is faster than its drive was, as `docs/method/bank.md` has it.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.log.logfile import RunData, block_period_ns, sample_times_s
from bridge.log.metadata import number_of, source_of_import, texts_of
from cockpit.judge.strokes import steady_parts, strokes_of
from diagnosis.features.cycles import Cycles, find_cycles, smallest_drop_N

Floats = npt.NDArray[np.floating[Any]]

_BIN_S = 1e-3  # of means, as slips are found in
_BESIDE_S = 0.02  # before and after a fall, in which the drive's velocity is looked at
_STOPS = 0.5  # of the drive's velocity before the fall
# Velocity of the slide over the drive's, mean from 10 to 90 % of a fall: that of a sine whose peak is the 1.5 v_d of a slip.
_RUNS_AHEAD = 1.4


def cycles_of(run: RunData) -> Cycles | None:
    """The slips in the drive force of a log that was read; None where it holds no force. Raises Fault BAD_LOG.

    Forces at breakaway and re-stick have the sign that they have in the log.
    """
    if not len(run.sensors) or "drive_force_N" in absent_channels(run):
        return None
    force_N = run.sensors["drive_force_N"].astype(np.float64)
    finite = np.isfinite(force_N).all(axis=1)
    if not finite.any():
        return None
    imported = source_of_import(run.headers, run.path)
    period_ns = (
        block_period_ns(run.sensors)
        if imported
        else 1e9 * number_of(run.configuration("controller"), "block_s", run.path)
    )
    sensors, force_N = run.sensors[finite], force_N[finite]
    sample_s = sample_times_s(sensors, period_ns)
    slowest_fall_s, drop_N = _slowest_fall_s(run), smallest_drop_N(sample_s.ravel(), force_N.ravel())
    bins = math.gcd(force_N.shape[1], max(round(period_ns * 1e-9 / _BIN_S), 1))  # of a block
    drive_m, slide_m = (_place_m(run, sensors, name, bins) for name in ("drive_position_m", "mass_position_m"))
    found: list[Cycles] = []
    for first, end, way in strokes_of(drive_m[::bins]):
        along_N = way * force_N[first:end]
        cycles = find_cycles(sample_s[first:end].ravel(), along_N.ravel(), drop_N, slowest_fall_s)
        inside = slice(first * bins, end * bins)
        t_s = sample_s[first:end, :: force_N.shape[1] // bins].ravel()
        stroke = _Stroke(t_s, _means(along_N, bins), way * drive_m[inside], way * slide_m[inside])
        found.append(_signed(_slips_among(cycles, stroke, period_ns * 1e-9 / bins), way))
    return Cycles(*(np.concatenate(parts) for parts in zip(*found, strict=True)))


def steady_parts_of(run: RunData) -> npt.NDArray[np.int64]:
    """In the steady part of which stroke of the drive each block of a log is, as `steady_parts` has it. Raises Fault BAD_LOG."""
    sensors = run.sensors
    if not len(sensors):
        return np.zeros(0, np.int64)
    mean_N = sensors["drive_force_N"].mean(axis=1, dtype=np.float64)
    return steady_parts(_place_m(run, sensors, "drive_position_m", 1), mean_N, block_period_ns(sensors) * 1e-9)


def absent_channels(run: RunData) -> list[str]:
    """Channels that the file of another program did not hold; they are zeros in its log. Raises Fault BAD_LOG."""
    return texts_of(run.headers, "import", "missing", run.path)


def _slowest_fall_s(run: RunData) -> float:
    """How long a slip may last: 1.6 times that of the plant's slide on its spring, and never less than 0.1 s."""
    if "plant" not in run.headers:
        return 0.1
    try:
        rig = run.configuration("plant")["rig"]
        return max(0.1, 3.0 * math.sqrt(rig["slide"]["mass_kg"] / rig["drive"]["stiffness_N_per_m"]))
    except (KeyError, TypeError, ValueError, ArithmeticError):  # another rig need not tell
        return 0.1


class _Stroke(NamedTuple):
    """A stroke of the drive, all along the drive; no number where a place is not known. [bins]."""

    t_s: Floats
    force_N: Floats
    drive_m: Floats
    slide_m: Floats


def _means(samples: Any, bins: int) -> Floats:
    """Means of the bins of blocks, one after the other."""
    return samples.reshape(len(samples), bins, -1).mean(axis=2, dtype=np.float64).ravel()


def _place_m(run: RunData, sensors: Any, name: str, bins: int) -> Floats:
    """Means of bins, straight lines where they are no numbers; NaN throughout for a channel that is not there, or stands."""
    place_m = _means(sensors[name], bins)
    known = np.flatnonzero(np.isfinite(place_m))
    if name in absent_channels(run) or not len(known) or np.ptp(place_m[known]) == 0.0:
        return np.full(len(place_m), np.nan)
    return np.interp(np.arange(len(place_m)), known, place_m[known])


def _signed(cycles: Cycles, way: int) -> Cycles:
    return cycles._replace(
        breakaway_force_N=way * cycles.breakaway_force_N, restick_force_N=way * cycles.restick_force_N
    )


def _slips_among(falls: Cycles, stroke: _Stroke, bin_s: float) -> Cycles:
    first = np.searchsorted(stroke.t_s, falls.breakaway_t_s, side="right") - 1
    last = [*first, len(stroke.t_s) - 1][1:]
    slips = np.array([_is_slip(stroke, a, b, bin_s) for a, b in zip(first, last, strict=True)], bool)
    stick = slips[: len(falls.restick_t_s)]
    return Cycles(
        falls.breakaway_t_s[slips],
        falls.breakaway_force_N[slips],
        falls.restick_t_s[stick],
        falls.restick_force_N[stick],
    )


def _is_slip(stroke: _Stroke, first: int, last: int, bin_s: float) -> bool:
    """Whether the slide runs ahead in the fall of the force between two bins; its place not known: whether the drive goes on."""
    force_N = stroke.force_N[first : last + 1]
    force_N = force_N[: int(force_N.argmin()) + 1]
    drop_N = float(force_N[0] - force_N[-1])
    begin = first + int(np.flatnonzero(force_N >= force_N[0] - 0.1 * drop_N)[-1])
    end = first + int(np.flatnonzero(force_N <= force_N[0] - 0.9 * drop_N)[0])
    beside = max(end - begin, math.ceil(_BESIDE_S / bin_s))
    before, after = max(begin - beside, 0), min(end + beside, len(stroke.t_s) - 1)
    if not before < begin < end < after:
        return True
    was = (stroke.drive_m[begin] - stroke.drive_m[before]) / (begin - before)
    goes_on = (stroke.drive_m[after] - stroke.drive_m[end]) / (after - end)
    slides, drives = ((place_m[end] - place_m[begin]) / (end - begin) for place_m in (stroke.slide_m, stroke.drive_m))
    if not slides > drives:  # no place, or one that is wrong: a force falls only where the slide outruns its drive
        return not goes_on < _STOPS * was
    return not slides <= _RUNS_AHEAD * max(was, goes_on)
