"""Features of a run with a spring drive; none depends on the instants of the slips.

Features of a segment of constant command: means and trends over the cycles, shapes aligned at the middle of a slip, the level
over time without slips, the measured vibration. Features of a run: relations between channels that need no friction model. A
measured and a predicted run pass through the same code; a feature that a run does not have is NaN.
"""

import math
from functools import lru_cache
from itertools import pairwise

import numpy as np
from scipy.fft import dct

from bridge.arrays import Floats
from diagnosis.features.feature import DRIVE_WAVES, HIGH, LOW, MIDDLE, RESOLVED_M, Features, Scales, Signals
from diagnosis.features.grid import BLOCK_S
from diagnosis.features.moving_mean import moving_mean
from diagnosis.features.segments import CommandedRun, Segment
from diagnosis.features.slips import NO_SLIPS, SHAPE_AT, SegmentSlips, find_slips, slip_pairs
from diagnosis.features.spring_law import spring_bend, spring_law

_LOW_AND_HIGH = np.array([0.05, 0.95])
_LEVELS = 8  # number of bins over a segment without slips
_BREAKAWAY_WAVES = 5  # half waves of the breakaway force over a segment; more follow shorter friction waves and noise


def spring_features(signals: Signals, commands: CommandedRun, scales: Scales, labelled: bool = True) -> Features:
    """All features of a run with a spring drive; the list of features depends on commands and channels alone.

    Args:
        signals: [blocks] each, measured or predicted, from `without_vibration`.
        commands: commands of the run, with settled segments.
        scales: scales of the rig.
        labelled: whether the labels are wanted; without them the call takes a tenth less time.

    """
    features = Features(labelled)
    for number, segment in enumerate(commands.segments):
        inside = slice(segment.first, segment.last)
        cut = {
            name: values[inside] if name.endswith("shake_mps2") else segment.sign * values[inside]
            for name, values in signals.items()
        }
        slips = find_slips(cut, scales) if segment.slips > 0 else NO_SLIPS
        if "drive_force_N" in cut:
            travel_m = abs(segment.drive_velocity_mps) * (segment.last - segment.first) * BLOCK_S
            expected = travel_m * scales.stiffness_N_per_m / scales.fall_N
            _cycles(features, number, cut["drive_force_N"], slips, segment, expected)
            _level(features, number, cut["drive_force_N"], slips, segment)
        _period(features, number, slips, segment)
        _shapes(features, number, cut, slips, scales, segment.frequency_Hz)
        if segment.frequency_Hz > 0.0:
            _vibration(features, number, cut)
    _parity(features, signals, commands, scales)
    if "drive_position_m" in signals:
        _drive(features, signals["drive_position_m"], commands)
    return features


_CYCLE_WAVES = {"breakaway": _BREAKAWAY_WAVES, "restick": 3}
_LACKING = [math.nan] * _BREAKAWAY_WAVES
_MOMENTS = {
    regime: tuple((name, regime) for name in ("mean", *(f"wave {wave}" for wave in range(1, waves + 1)), "scatter"))
    for regime, waves in _CYCLE_WAVES.items()
}
_RATES = tuple((f"rate {part}", "stick") for part in ("early", "middle", "late"))


def _cycles(
    features: Features, number: int, force_N: Floats, slips: SegmentSlips, segment: Segment, expected: float
) -> None:
    name = "drive_force_N"
    for regime, at in (("breakaway", slips.tops), ("restick", slips.bottoms)):
        waves = _CYCLE_WAVES[regime]
        carried = min(waves, max(int(expected / 2.0) - 1, 0)) if expected >= 5.0 else 0
        moments, scatter = _moments(force_N[at], at / len(force_N), slips.weights, carried)
        values = [*moments, *_LACKING[carried:waves], scatter]
        features.add_all(_MOMENTS[regime], name, LOW, number, values)
    # the climb between a re-stick and the next breakaway, in three parts
    rates = np.full(3, np.nan)
    weights = slip_pairs(slips)
    if segment.sticks and weights.sum() > 0.1:
        start, end = slips.bottoms[:-1], slips.tops[1:]
        blocks = np.arange(len(force_N))
        level = [np.interp(start + share * (end - start), blocks, force_N) for share in (0.1, 0.4, 0.7, 0.95)]
        length = (end - start) * BLOCK_S
        parts = zip(level[:-1], level[1:], (0.3, 0.3, 0.25), strict=True)
        rates = np.array([float(weights @ ((high - low) / (share * length))) for low, high, share in parts])
        rates /= weights.sum()
    features.add_all(_RATES, name, LOW, number, rates.tolist())


def _moments(values: Floats, at: Floats, weights: Floats, carried: int) -> tuple[list[float], float]:
    """Mean and `carried` cosine waves of `values` [slips] over the segment, and the mean square of the remainder.

    NaN where there are too few slips.
    """
    total = float(weights.sum())
    moments = [math.nan] * (carried + 1)
    if total <= 0.1:
        return moments, math.nan
    mean = float(weights @ values) / total
    moments[0] = mean
    if len(values) < carried + 2:
        return moments, math.nan
    root = np.sqrt(weights)
    columns = np.cos(np.pi * np.outer(at, np.arange(carried + 1)))
    fitted, *_ = np.linalg.lstsq(columns * root[:, None], values * root, rcond=None)
    moments[1:] = fitted[1:].tolist()
    left = values - columns @ fitted
    free = total - carried - 1.0
    return moments, float(weights @ (left * left)) / free if free > 1.0 else math.nan


def _period(features: Features, number: int, slips: SegmentSlips, segment: Segment) -> None:
    weights = slip_pairs(slips)
    periods_s = np.diff(slips.middles) * BLOCK_S
    known = segment.sticks and weights.sum() > 0.1
    value = math.log(float(weights @ periods_s) / float(weights.sum())) if known else math.nan
    features.add("period", "drive_force_N", "stick", LOW, number, value)


_LEVEL_NAMES = tuple(
    (name, "steady")
    for name in ("mean level", "deviation", "low level", "high level", *(f"level {bin_}" for bin_ in range(_LEVELS)))
)


def _level(features: Features, number: int, force_N: Floats, slips: SegmentSlips, segment: Segment) -> None:
    """Add levels of the force: over complete cycles with the weights of their slips; over the segment without slips.

    A jump of the force at the start of a segment, due to a delayed force sensor, looks like a slip. It has weight 0, and its
    cycle must not count in the level (docs/method/diagnosis.md).
    """
    name = "drive_force_N"
    still = segment.still and not segment.at_the_edge
    counted_N, counts = force_N, np.ones(len(force_N))
    weights = slip_pairs(slips)
    if weights.sum() > 0.1:
        counted_N, counts = force_N[slips.tops[0] : slips.tops[-1]], np.repeat(weights, np.diff(slips.tops))
    levels = np.full(4, np.nan)
    if still or (segment.slips > 2 and not segment.at_the_edge):
        total = counts.sum()
        mean_N = (counted_N * counts).sum() / total
        about_N = counted_N - mean_N
        levels = np.array([mean_N, ((about_N * about_N) * counts).sum() / total, *_quantiles(counted_N, counts)])
        levels[1] **= 0.5
    bins = [math.nan] * _LEVELS
    middle = fast = math.nan
    if still:
        edges = np.linspace(0, len(force_N), _LEVELS + 1).astype(np.int64).tolist()
        bins = [_mean(force_N[first:last]) for first, last in pairwise(edges)]
        short = moving_mean(force_N, 5)
        middle, fast = float(np.var(short - moving_mean(force_N, 100))), float(np.var(force_N - short))
    features.add_all(_LEVEL_NAMES, name, LOW, number, [*levels.tolist(), *bins])
    features.add("ripple", name, "steady", MIDDLE, number, middle)
    features.add("ripple", name, "steady", HIGH, number, fast)


def _quantiles(values: Floats, weights: Floats) -> Floats:
    """Same result as `numpy.quantile` at 5 and 95 % by the inverted distribution, in a fifth of its time."""
    order = np.argsort(values)
    share = weights[order].cumsum()
    share /= share[-1]
    quantiles = values[order[np.minimum(np.searchsorted(share, _LOW_AND_HIGH), len(values) - 1)]]
    return np.full(2, np.nan) if np.isnan(values[order[-1]]) else quantiles  # NaN: the model diverges


def _mean(values: Floats) -> float:
    """Same result as `values.mean()`, which takes five times as long for some hundred values."""
    return float(np.add.reduce(values)) / len(values)


def _regime(at: float) -> str:
    return "breakaway" if at < -0.4 else "slip" if at < 0.6 else "restick"


_SHAPES = tuple((f"shape {instant:g}", _regime(instant)) for instant in SHAPE_AT.tolist())


def _shapes(
    features: Features, number: int, cut: Signals, slips: SegmentSlips, scales: Scales, frequency_Hz: float
) -> None:
    width = scales.slip_s / BLOCK_S
    shaken = frequency_Hz > 0.0  # an aliased vibration would look like a ring
    names = [name for name in ("drive_force_N", "mass_accel_mps2", "base_accel_mps2", "mass_position_m") if name in cut]
    if not names:
        return
    shapes, powers = np.full((len(names), len(SHAPE_AT)), np.nan), np.full(len(names), np.nan)
    if slips.some:
        signals = np.array([cut[name] for name in names])
        last = signals.shape[1] - 1
        inside = slips.weights > 0.0
        middles = slips.middles[inside, None]
        weights = slips.weights[inside] / max(float(slips.weights.sum()), 1e-9)
        at = np.clip(middles + SHAPE_AT * width, 0.0, last)
        before = np.minimum(at.astype(np.int64), last - 1)
        low = signals[:, before]
        shapes = weights @ (low + (at - before) * (signals[:, before + 1] - low))
        fast = np.array([signal - moving_mean(signal, 5) for signal in signals])
        rings = fast[:, np.minimum((middles + np.arange(int(3.0 * width))).astype(np.int64), last)]
        powers = np.einsum("nij,nij,i->n", rings, rings, weights) / rings.shape[2]
    for i, name in enumerate(names):
        shape, ring = shapes[i], math.nan if shaken and name.endswith("accel_mps2") else float(powers[i])
        if name == "drive_force_N":
            shape = shape - shape.mean()
        if name == "mass_position_m":
            shape = shape - shape[0]
        features.add_all(_SHAPES, name, MIDDLE, number, shape.tolist())
        features.add("ring", name, "restick", HIGH, number, ring)


def _vibration(features: Features, number: int, cut: Signals) -> None:
    for name, source in (("base_shake_mps2", "base_accel_mps2"), ("mass_shake_mps2", "mass_accel_mps2")):
        if name not in cut:
            continue
        shake = cut[name]
        mean = float(shake.mean())
        features.add("vibration", source, "steady", HIGH, number, math.log(mean + 1e-9))
        if source == "base_accel_mps2":
            time = _line(len(shake))
            shaken = mean > 0.0  # a dead sensor or a tripped amplifier gives 0
            over_time = float(shake @ time) / (mean * len(shake) / 3.0) if shaken else math.nan
            features.add("vibration over time", source, "steady", HIGH, number, over_time)
            if "drive_force_N" in cut:
                force = cut["drive_force_N"] - cut["drive_force_N"].mean()
                over_force = float(shake @ force) / (mean * (float(force @ force) + 1e-9)) if shaken else math.nan
                features.add("vibration over force", source, "steady", HIGH, number, over_force)


def _parity(features: Features, signals: Signals, commands: CommandedRun, scales: Scales) -> None:
    """Add the relations between channels of a run that hold for any friction."""
    if not {"drive_force_N", "mass_position_m", "drive_position_m"} <= signals.keys():
        return
    force_N, extension_m = signals["drive_force_N"], signals["drive_position_m"] - signals["mass_position_m"]
    law = spring_law(force_N, extension_m, commands.segments, scales.force_N, scales.stiffness_N_per_m)
    law["bend"] = spring_bend(force_N, extension_m, commands.segments, scales.slip_s)
    for name, value in law.items():
        features.add(f"spring {name}", "drive_force_N", "stick", MIDDLE if name == "rest" else LOW, -1, value)


_DRIVE_WAVES = tuple((f"wave {wave}", "steady") for wave in range(1, DRIVE_WAVES + 1))


def _drive(features: Features, position_m: Floats, commands: CommandedRun) -> None:
    """Add waves and power of the drive position's deviation from a line and a bow in each segment."""
    rest_m = np.zeros_like(position_m)
    for segment in commands.segments:
        rows = slice(segment.first, segment.last)
        rest_m[rows] = _without_line(position_m[rows], segment)
    waves = np.asarray(dct(rest_m))[1 : DRIVE_WAVES + 1] / len(rest_m)
    features.add_all(_DRIVE_WAVES, "drive_position_m", LOW, -1, waves.tolist())
    fast = rest_m - moving_mean(rest_m, 100)
    features.add("rest", "drive_position_m", "steady", MIDDLE, -1, float(fast.var()) + RESOLVED_M**2)


def _without_line(position_m: Floats, segment: Segment) -> Floats:
    rest = position_m - position_m.mean()
    for column, power in _line_and_bow(segment.last - segment.first):
        rest -= column * (float(rest @ column) / power)
    return rest


@lru_cache(maxsize=64)
def _line(blocks: int) -> Floats:
    return np.linspace(-1.0, 1.0, blocks)


@lru_cache(maxsize=64)
def _line_and_bow(blocks: int) -> tuple[tuple[Floats, float], ...]:
    """A line (zero of the sensor, and speed) and a bow (linearity of the sensor): [blocks] each, with its sum of squares."""
    line = _line(blocks)
    bow = line * line - 1.0 / 3.0
    return (line, float(line @ line)), (bow, float(bow @ bow))
