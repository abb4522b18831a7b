"""What a run looks like, in numbers that do not depend on when its slips happen.

Everything is taken per segment of constant command: means and trends over the cycles, shapes aligned at the middle of a
slip, the level over time where nothing slips, the vibration that arrives; and per run the parity relations between channels
that need no friction model. A measured and a predicted run pass through the same code; a feature that one of them does not
have is NaN.
"""

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.fft import dct
from scipy.ndimage import uniform_filter1d
from scipy.signal import lfilter

from diagnosis.commands import Commands, Segment
from diagnosis.cycles import half_fallen, turning_points
from diagnosis.reduced import BLOCK_S
from diagnosis.spring_law import spring_bend, spring_law

Floats = npt.NDArray[np.floating[Any]]
Signals = dict[str, Floats]
Band = tuple[float, float]
LOW: Band = (0.0, 5.0)
MIDDLE: Band = (5.0, 50.0)
HIGH: Band = (50.0, 500.0)
# features that are powers of what is left: noise and roughness add to them
POWERS = frozenset({"scatter", "ring", "ripple", "rest", "spring rest"})
# instants of a slip at which its shape is read, in half periods of the mass on its spring after the middle of the fall
SHAPE_AT = np.array([-1.5, -1.0, -0.75, -0.5, -0.35, -0.2, 0.0, 0.2, 0.35, 0.5, 0.75, 1.0, 1.5, 2.0])
_LEVELS = 8  # bins of a segment without slips
_BREAKAWAY_WAVES = 5
_ENOUGH_SLIPS = 0.5  # sum of their weights
_LEVEL = 0.15  # of the static friction: sliding under a friction wave changes by less
_TAPER = 0.12  # of a segment, from its ends, over which slips come to count in full
DRIVE_WAVES = 24
RESOLVED_M = 1e-9  # a commanded position that was logged as measured has no noise but the rounding of its sums


class Feature(NamedTuple):
    """What a number of the vector is, and where it belongs."""

    name: str
    signal: str
    regime: str  # stick, breakaway, slip, restick, steady
    band_Hz: Band
    segment: int  # of the run; -1: the whole run


class Scales(NamedTuple):
    """Typical numbers of a rig, by which windows are sized and logarithms kept finite."""

    force_N: float  # static friction
    slip_s: float  # half a period of the mass on its spring
    drop_N: float  # smallest fall of the force that is a slip
    stiffness_N_per_m: float
    fall_N: float  # of the force in a slip: twice the static less the Coulomb friction


class Features:
    """Collects features of one run."""

    def __init__(self) -> None:
        self._labels: list[tuple[str, str, str, Band, int]] = []
        self.values: list[float] = []

    @property
    def labels(self) -> list[Feature]:
        """What the values are; a prediction is never asked, and thousands are made."""
        return [Feature(*label) for label in self._labels]

    def add(self, name: str, signal: str, regime: str, band_Hz: Band, segment: int, value: float) -> None:
        """Append one number; NaN where this run has no such thing."""
        self._labels.append((name, signal, regime, band_Hz, segment))
        self.values.append(value)


class Slips(NamedTuple):
    """The slips of a segment: blocks of breakaway and re-stick, where half of the fall is done, and how much each counts.

    A slip counts less towards the ends of its segment and nothing at them: one that comes in or goes out as a parameter
    moves must not make the features jump, or no fit finds its way.
    """

    tops: npt.NDArray[np.int64]
    bottoms: npt.NDArray[np.int64]
    middles: Floats
    weights: Floats

    @property
    def some(self) -> bool:
        """Whether there is enough of a slip to speak of."""
        return float(self.weights.sum()) > 0.1


def _pairs(slips: Slips) -> Floats:
    """How much each stick between two slips counts."""
    return np.minimum(slips.weights[:-1], slips.weights[1:])


NO_SLIPS = Slips(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0), np.zeros(0))


def spring_features(signals: Signals, commands: Commands, scales: Scales) -> Features:
    """All features of a run with a spring drive; which ones, depends on commands and channels only."""
    found = Features()
    for number, segment in enumerate(commands.segments):
        own = slice(segment.first, segment.last)
        cut = {
            name: values[own] if name.endswith("shake_mps2") else segment.sign * values[own]
            for name, values in signals.items()
        }
        slips = find_slips(cut, scales)
        if segment.slips == 0:
            slips = NO_SLIPS
        if "drive_force_N" in cut:
            travel_m = abs(segment.drive_velocity_mps) * (segment.last - segment.first) * BLOCK_S
            expected = travel_m * scales.stiffness_N_per_m / scales.fall_N
            _cycles(found, number, cut["drive_force_N"], slips, segment, expected)
            _level(found, number, cut["drive_force_N"], slips, segment)
        _period(found, number, slips, segment)
        _shapes(found, number, cut, slips, scales, segment.frequency_Hz)
        if segment.frequency_Hz > 0.0:
            _vibration(found, number, cut)
    _parity(found, signals, commands, scales)
    if "drive_position_m" in signals:
        _drive(found, signals["drive_position_m"], commands)
    return found


def settled(signals: Signals, segment: Segment, scales: Scales) -> Segment:
    """A segment without what its start decides, and with what it shows: slips, even sliding, or neither, as in a first climb.

    With three slips or more it begins in the second stick: how loaded the spring was and how old the contact is past then. A
    single slip at an end or a climb that just does not slip would come and go with every parameter: nothing is read from them.
    """
    cut = {name: segment.sign * values[segment.first : segment.last] for name, values in signals.items()}
    slips = find_slips(cut, scales)
    if float(slips.weights.sum()) > _ENOUGH_SLIPS:
        segment = segment._replace(slips=len(slips.tops))
    if len(slips.tops) == 0:
        return segment._replace(still="drive_force_N" not in cut or not _climbs(cut["drive_force_N"], scales))
    if len(slips.bottoms) >= 3:
        stick = int(slips.tops[1] - slips.bottoms[0])
        start = int(slips.bottoms[0]) + int(0.4 * stick)
        segment = segment._replace(first=segment.first + start)
        slips = find_slips({name: values[start:] for name, values in cut.items()}, scales)
    return segment._replace(sticks=float(_pairs(slips).sum()) > _ENOUGH_SLIPS)


def _climbs(force_N: Floats, scales: Scales) -> bool:
    """Or falls: its second half, over fiftieths of a segment, is not level."""
    half = force_N[len(force_N) // 2 :]
    width = max(len(force_N) // 50, 1)
    level_N = half[: len(half) // width * width].reshape(-1, width).mean(axis=1)
    return float(np.ptp(level_N)) > _LEVEL * scales.force_N


def find_slips(cut: Signals, scales: Scales) -> Slips:
    """The slips of a segment whose signals are cut out and turned into the direction of the drive."""
    if "drive_force_N" in cut:
        falling = cut["drive_force_N"]
        tops, bottoms = turning_points(falling, scales.drop_N)
    else:
        # no force: the slide's velocity, an integral that leaks over two slips, rises and falls once a slip
        keep = math.exp(-BLOCK_S / (2.0 * scales.slip_s))
        falling = -np.asarray(lfilter([BLOCK_S], [1.0, -keep], cut["mass_accel_mps2"]))
        swing_mps = scales.drop_N * math.pi / (scales.stiffness_N_per_m * scales.slip_s)  # over sqrt(stiffness x mass)
        tops, bottoms = turning_points(falling, max(0.3 * float(np.ptp(falling)), swing_mps))
    tops = tops[: len(bottoms)]
    # what takes ten times as long as a slip is a change of level
    quick = (bottoms - tops) * BLOCK_S < 10.0 * scales.slip_s
    tops, bottoms = tops[quick], bottoms[quick]
    middles = half_fallen(falling, tops, bottoms)
    width = scales.slip_s / BLOCK_S
    margin = np.minimum(middles + SHAPE_AT[0] * width, len(falling) - 1 - middles - SHAPE_AT[-1] * width)
    return Slips(tops, bottoms, middles, np.clip(margin / (_TAPER * len(falling)), 0.0, 1.0))


def _cycles(found: Features, number: int, force_N: Floats, slips: Slips, segment: Segment, expected: float) -> None:
    name = "drive_force_N"
    for regime, at, waves in (("breakaway", slips.tops, _BREAKAWAY_WAVES), ("restick", slips.bottoms, 3)):
        carried = min(waves, max(int(expected / 2.0) - 1, 0)) if expected >= 5.0 else 0
        moments, scatter = _moments(force_N[at], at / len(force_N), slips.weights, carried)
        found.add("mean", name, regime, LOW, number, moments[0])
        for wave in range(1, waves + 1):
            found.add(f"wave {wave}", name, regime, LOW, number, moments[wave] if wave <= carried else math.nan)
        found.add("scatter", name, regime, LOW, number, scatter)
    # the climb between a re-stick and the next breakaway, in three parts
    rates = np.full(3, np.nan)
    weights = _pairs(slips)
    if segment.sticks and weights.sum() > 0.1:
        start, end = slips.bottoms[:-1], slips.tops[1:]
        blocks = np.arange(len(force_N))
        level = [np.interp(start + share * (end - start), blocks, force_N) for share in (0.1, 0.4, 0.7, 0.95)]
        length = (end - start) * BLOCK_S
        parts = zip(level[:-1], level[1:], (0.3, 0.3, 0.25), strict=True)
        rates = np.array([float(weights @ ((high - low) / (share * length))) for low, high, share in parts])
        rates /= weights.sum()
    for part, rate in zip(("early", "middle", "late"), rates, strict=True):
        found.add(f"rate {part}", name, "stick", LOW, number, float(rate))


def _moments(values: Floats, at: Floats, weights: Floats, carried: int) -> tuple[list[float], float]:
    """Mean and cosine waves over the segment, and the power of what is left; NaN where there are too few slips."""
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


def _period(found: Features, number: int, slips: Slips, segment: Segment) -> None:
    weights = _pairs(slips)
    periods_s = np.diff(slips.middles) * BLOCK_S
    known = segment.sticks and weights.sum() > 0.1
    value = math.log(float(weights @ periods_s) / float(weights.sum())) if known else math.nan
    found.add("period", "drive_force_N", "stick", LOW, number, value)


def _level(found: Features, number: int, force_N: Floats, slips: Slips, segment: Segment) -> None:
    """Levels over whole cycles, as much as their slips count; over the segment where nothing slips.

    A jump at the start of a segment, as a late force makes it, is a slip of no weight. Counted as one it moved a mean level by
    six floors, and a slow sensor was named.
    """
    name = "drive_force_N"
    still = segment.still and not segment.at_the_edge
    whole, counts = force_N, np.ones(len(force_N))
    weights = _pairs(slips)
    if weights.sum() > 0.1:
        whole, counts = force_N[slips.tops[0] : slips.tops[-1]], np.repeat(weights, np.diff(slips.tops))
    levels = np.full(4, np.nan)
    if still or (segment.slips > 2 and not segment.at_the_edge):
        mean_N = np.average(whole, weights=counts)
        deviation_N = np.average((whole - mean_N) ** 2, weights=counts) ** 0.5
        levels = np.array(
            [mean_N, deviation_N, *np.quantile(whole, (0.05, 0.95), weights=counts, method="inverted_cdf")]
        )
    for level, value in zip(("mean level", "deviation", "low level", "high level"), levels.tolist(), strict=True):
        found.add(level, name, "steady", LOW, number, value)
    edges = np.linspace(0, len(force_N), _LEVELS + 1).astype(np.int64)
    for bin_ in range(_LEVELS):
        value = float(force_N[edges[bin_] : edges[bin_ + 1]].mean()) if still else math.nan
        found.add(f"level {bin_}", name, "steady", LOW, number, value)
    middle = fast = math.nan
    if still:
        short = uniform_filter1d(force_N, 5)
        middle, fast = float(np.var(short - uniform_filter1d(force_N, 100))), float(np.var(force_N - short))
    found.add("ripple", name, "steady", MIDDLE, number, middle)
    found.add("ripple", name, "steady", HIGH, number, fast)


def _regime(at: float) -> str:
    return "breakaway" if at < -0.4 else "slip" if at < 0.6 else "restick"


_SHAPES = tuple((f"shape {instant:g}", _regime(instant)) for instant in SHAPE_AT.tolist())


def _shapes(found: Features, number: int, cut: Signals, slips: Slips, scales: Scales, frequency_Hz: float) -> None:
    width = scales.slip_s / BLOCK_S
    shaken = frequency_Hz > 0.0  # a vibration that the sampling folds down would pass for a ring
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
        fast = signals - uniform_filter1d(signals, 5)
        rings = fast[:, np.minimum((middles + np.arange(int(3.0 * width))).astype(np.int64), last)]
        powers = np.einsum("nij,nij,i->n", rings, rings, weights) / rings.shape[2]
    for i, name in enumerate(names):
        shape, ring = shapes[i], math.nan if shaken and name.endswith("accel_mps2") else float(powers[i])
        if name == "drive_force_N":
            shape = shape - shape.mean()
        if name == "mass_position_m":
            shape = shape - shape[0]
        for (label, regime), value in zip(_SHAPES, shape.tolist(), strict=True):
            found.add(label, name, regime, MIDDLE, number, value)
        found.add("ring", name, "restick", HIGH, number, ring)


def _vibration(found: Features, number: int, cut: Signals) -> None:
    for name, source in (("base_shake_mps2", "base_accel_mps2"), ("mass_shake_mps2", "mass_accel_mps2")):
        if name not in cut:
            continue
        shake = cut[name]
        mean = float(shake.mean())
        found.add("vibration", source, "steady", HIGH, number, math.log(mean + 1e-9))
        if source == "base_accel_mps2":
            time = np.linspace(-1.0, 1.0, len(shake))
            shaken = mean > 0.0  # a sensor that went dead, or an amplifier that tripped, shows nothing to divide by
            over_time = float(shake @ time) / (mean * len(shake) / 3.0) if shaken else math.nan
            found.add("vibration over time", source, "steady", HIGH, number, over_time)
            if "drive_force_N" in cut:
                force = cut["drive_force_N"] - cut["drive_force_N"].mean()
                over_force = float(shake @ force) / (mean * (float(force @ force) + 1e-9)) if shaken else math.nan
                found.add("vibration over force", source, "steady", HIGH, number, over_force)


def _parity(found: Features, signals: Signals, commands: Commands, scales: Scales) -> None:
    """Relations of a run that hold whatever the friction is."""
    if not {"drive_force_N", "mass_position_m", "drive_position_m"} <= signals.keys():
        return
    force_N, extension_m = signals["drive_force_N"], signals["drive_position_m"] - signals["mass_position_m"]
    law = spring_law(force_N, extension_m, commands.segments, scales.force_N, scales.stiffness_N_per_m)
    law["bend"] = spring_bend(force_N, extension_m, commands.segments, scales.slip_s)
    for name, value in law.items():
        found.add(f"spring {name}", "drive_force_N", "stick", MIDDLE if name == "rest" else LOW, -1, value)


def _drive(found: Features, position_m: Floats, commands: Commands) -> None:
    """Waves of what the drive position does besides its even path."""
    rest_m = np.zeros_like(position_m)
    for segment in commands.segments:
        rows = slice(segment.first, segment.last)
        rest_m[rows] = _without_line(position_m[rows], segment)
    waves = np.asarray(dct(rest_m))[1 : DRIVE_WAVES + 1] / len(rest_m)
    for wave, value in enumerate(waves.tolist(), start=1):
        found.add(f"wave {wave}", "drive_position_m", "steady", LOW, -1, value)
    fast = rest_m - uniform_filter1d(rest_m, 100)
    found.add("rest", "drive_position_m", "steady", MIDDLE, -1, float(fast.var()) + RESOLVED_M**2)


def _without_line(position_m: Floats, segment: Segment) -> Floats:
    rest = position_m - position_m.mean()
    for column, power in _line_and_bow(segment.last - segment.first):
        rest -= column * (float(rest @ column) / power)
    return rest


@lru_cache(maxsize=64)
def _line_and_bow(blocks: int) -> tuple[tuple[Floats, float], ...]:
    """A line, a sensor's zero and the speed, and a bow, its linearity: [blocks], and the square of each."""
    line = np.linspace(-1.0, 1.0, blocks)
    bow = line * line - 1.0 / 3.0
    return (line, float(line @ line)), (bow, float(bow @ bow))
