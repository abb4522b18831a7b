"""Features of a run with a spring drive; none depends on the instants of the slips.

Features of a segment of constant command: means and trends over the cycles, shapes aligned at the middle of a slip, the level
over time without slips, the measured vibration. Features of a run: relations between channels that need no friction model. A
measured and a predicted run pass through the same code; a feature that a run does not have is NaN.
"""

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy.fft import dct
from scipy.ndimage import uniform_filter1d

from bridge.arrays import Floats
from diagnosis.features.feature import DRIVE_WAVES, HIGH, LOW, MIDDLE, RESOLVED, Features, Scales, Signals
from diagnosis.features.grid import BLOCK_S
from diagnosis.features.segments import CommandedRun, Segment
from diagnosis.features.slips import NO_SLIPS, SHAPE_AT, SegmentSlips, find_slips, slip_pairs

_ENTRY_MARGIN = 10  # blocks left out around the start of a segment: longer than the delays of a measuring chain
# Widths of two moving means, in slip durations; the bend is fitted to the band between them. Shorter short mean: noise of the
# displacement sensors, which grows with the square of frequency; longer: it smears the slip. Longer long mean: a sensor's bow
# looks like a bend; shorter: the slip is removed. Counted on 60 rigs without a gap (docs/method/diagnosis.md).
_SHORT, _LONG = 0.25, 8.0
_LOW_AND_HIGH = 0.05, 0.95
_LEVELS = 8  # number of bins over a segment without slips
_BREAKAWAY_WAVES = 5  # half waves of the breakaway force over a segment; more follow shorter friction waves and noise
_CYCLE_WAVES = {"breakaway": _BREAKAWAY_WAVES, "restick": 3}
_LACKING = [math.nan] * _BREAKAWAY_WAVES
_MOMENTS = {
    regime: tuple((name, regime) for name in ("mean", *(f"wave {wave}" for wave in range(1, waves + 1)), "scatter"))
    for regime, waves in _CYCLE_WAVES.items()
}
_RATES = tuple((f"rate {part}", "stick") for part in ("early", "middle", "late"))
_LEVEL_NAMES = tuple(
    (name, "steady")
    for name in ("mean level", "deviation", "low level", "high level", *(f"level {bin_}" for bin_ in range(_LEVELS)))
)
_DRIVE_WAVES = tuple((f"wave {wave}", "steady") for wave in range(1, DRIVE_WAVES + 1))


def spring_law(
    force_N: Floats, extension_m: Floats, segments: Sequence[Segment], scale_N: float, stiffness_N_per_m: float
) -> dict[str, float]:
    """Part of the force [N] that follows the extension, its rate, its cube, time and direction; and the rest's mean square.

    The parts are fitted one after the other: stiffness, rate, cube, time, direction (NaN in a run of one direction), rest.

    Args:
        force_N, extension_m: [blocks] each.
        segments: segments of the run.
        scale_N, stiffness_N_per_m: typical force and stiffness, which scale the columns.

    """
    even = _away_from_entries(segments, len(force_N), _ENTRY_MARGIN)
    rate_mps = np.gradient(uniform_filter1d(extension_m, 5), BLOCK_S)[even]
    force_N, extension_m = force_N[even], extension_m[even]
    extension_m = extension_m - extension_m.mean() + force_N.mean() / stiffness_N_per_m
    reaches = extension_m * (stiffness_N_per_m / scale_N)
    both = force_N.min() < -0.3 * scale_N and force_N.max() > 0.3 * scale_N
    columns = {
        "stiffness": reaches,
        "rate": rate_mps * 1e3,
        "cube": reaches * reaches * reaches,  # `**` would take as long as the rest of this function
        "time": np.linspace(-1.0, 1.0, len(even))[even],
    }
    if both:
        columns["direction"] = np.sign(force_N)
    law, rest = _sequential_fit(columns, force_N)
    law.setdefault("direction", math.nan)
    return law | {"rest": max(rest, 0.0) / len(force_N)}


def spring_bend(force_N: Floats, extension_m: Floats, segments: Sequence[Segment], slip_s: float) -> float:
    """The force [N] for each m/s2 of the extension's second derivative, in the band of the slips.

    A force with a delay of T is F - T F' + T^2 F'' / 2. Behind n equal low-passes with the same total delay, the factor of T^2
    F'' is (n + 1) / (2 n) instead of 1/2. A swinging frame bends the force without a delay. So the bend separates a delay, a
    low-pass and a frame.
    """
    short, long = (max(round(slips * slip_s / BLOCK_S), 1) for slips in (_SHORT, _LONG))
    level_m = uniform_filter1d(extension_m, short)
    padded_m = np.pad(level_m, short, mode="edge")
    earlier_m, later_m = padded_m[: -2 * short], padded_m[2 * short :]
    columns = {
        "stiffness": level_m,
        "rate": (later_m - earlier_m) / (2 * short * BLOCK_S),
        "bend": (later_m - 2.0 * level_m + earlier_m) / (short * BLOCK_S) ** 2,
    }
    even = _away_from_entries(segments, len(force_N), _ENTRY_MARGIN + 2 * short)
    fast = {name: (values - uniform_filter1d(values, long))[even] for name, values in columns.items()}
    level_N = uniform_filter1d(force_N, short)
    law, _ = _sequential_fit(fast, (level_N - uniform_filter1d(level_N, long))[even])
    return law["bend"]


def _away_from_entries(segments: Sequence[Segment], blocks: int, about: int) -> npt.NDArray[np.bool_]:
    """Marks [blocks] without `about` blocks around the start of each segment, where the model starts at the measured force."""
    even = np.ones(blocks, np.bool_)
    for segment in segments:
        if segment.still or segment.slips > 0:
            even[max(segment.first - about, 0) : segment.first + about] = False
    return even


def _sequential_fit(columns: Mapping[str, Floats], force_N: Floats) -> tuple[dict[str, float], float]:
    """Coefficient of the force [blocks] on each column, orthogonal to the columns before it; and the rest's sum of squares.

    A fit of all columns at once would transfer the noise of a column to the others.
    """
    centred = np.array([*columns.values(), force_N])
    centred -= centred.mean(axis=1, keepdims=True)
    products = centred @ centred.T
    shares: dict[str, float] = {}
    for i, name in enumerate(columns):
        freed = products[i] / (products[i, i] + 1e-30)
        shares[name] = float(freed[-1])
        products -= np.outer(products[i], freed)
    return shares, float(products[-1, -1])


def spring_features(signals: Signals, commands: CommandedRun, scales: Scales) -> Features:
    """All features of a run with a spring drive; the list of features depends on commands and channels alone.

    Args:
        signals: [blocks] each, measured or predicted, from `without_vibration`.
        commands: commands of the run, with settled segments.
        scales: scales of the rig.

    """
    features = Features()
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
        levels = np.array(
            [
                mean_N,
                ((about_N * about_N) * counts).sum() / total,
                *np.quantile(counted_N, _LOW_AND_HIGH, weights=counts, method="inverted_cdf"),
            ]
        )
        levels[1] **= 0.5
    bins = [math.nan] * _LEVELS
    middle = fast = math.nan
    if still:
        edges = np.linspace(0, len(force_N), _LEVELS + 1).astype(np.int64).tolist()
        bins = [float(force_N[first:last].mean()) for first, last in pairwise(edges)]
        short = uniform_filter1d(force_N, 5)
        middle, fast = float(np.var(short - uniform_filter1d(force_N, 100))), float(np.var(force_N - short))
    features.add_all(_LEVEL_NAMES, name, LOW, number, [*levels.tolist(), *bins])
    features.add("ripple", name, "steady", MIDDLE, number, middle)
    features.add("ripple", name, "steady", HIGH, number, fast)


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
    if float(slips.weights.sum()) > 0.1:
        signals = np.array([cut[name] for name in names])
        last = signals.shape[1] - 1
        inside = slips.weights > 0.0
        middles = slips.middles[inside, None]
        weights = slips.weights[inside] / max(float(slips.weights.sum()), 1e-9)
        at = np.clip(middles + SHAPE_AT * width, 0.0, last)
        before = np.minimum(at.astype(np.int64), last - 1)
        low = signals[:, before]
        shapes = weights @ (low + (at - before) * (signals[:, before + 1] - low))
        fast = np.array([signal - uniform_filter1d(signal, 5) for signal in signals])
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


def _drive(features: Features, position_m: Floats, commands: CommandedRun) -> None:
    """Add waves and power of the drive position's deviation from a line and a bow in each segment."""
    rest_m, travel_m = np.zeros_like(position_m), BLOCK_S * float(np.abs(commands.drive).sum())
    for segment in commands.segments:
        rows = slice(segment.first, segment.last)
        rest_m[rows] = _without_line(position_m[rows], segment)
    waves = np.asarray(dct(rest_m))[1 : DRIVE_WAVES + 1] / len(rest_m)
    features.add_all(_DRIVE_WAVES, "drive_position_m", LOW, -1, waves.tolist())
    fast = rest_m - uniform_filter1d(rest_m, 100)
    features.add("rest", "drive_position_m", "steady", MIDDLE, -1, float(fast.var()) + (RESOLVED * travel_m) ** 2)


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
