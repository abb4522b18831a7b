"""Features of a force-driven axis: the force less the inertia, over velocity, position, direction and time.

Measured and predicted force are both sorted by the measured motion (`diagnosis.features.axis_motion`), so every mean is over the
same blocks. All features but the powers are linear in the force. Each step works on the remainder of the step before:

1. a curve over velocity, with a branch for speeding up and one for slowing down;
2. the parts that are proportional to the acceleration and to its rate;
3. waves over time and position, of the friction (with the sign of the velocity) and of a force without direction.
"""

import math

import numpy as np
import numpy.typing as npt
from scipy.fft import dct
from scipy.ndimage import uniform_filter1d

from bridge.arrays import Floats, Indices
from diagnosis.evidence.manifest import RigTable
from diagnosis.features.axis_motion import SlideMotion
from diagnosis.features.feature import LOW, Features, Signals
from diagnosis.features.grid import BLOCK_S
from diagnosis.features.segments import CommandedRun

# Blocks left out at either end of a run, where the window of the smoothed motion is one-sided. Too small: its errors count.
_EDGE = 50
# Edges of the slow bins, in Stribeck velocities. Below the first edge the slide is about to stick.
# More bins resolve the Stribeck curve; each bin then holds fewer blocks.
_SLOW = np.array([0.25, 0.5, 1.0, 2.0, 4.0])
_FAST = 8  # number of bins from the last slow edge to the greatest speed
# Travel, in presliding lengths F_s / k_t, before features count. Too small: the unknown load on the contact at the start of the
# run shows as a gap. Too large: short runs lose their features.
_FORGETTING_LENGTHS = 20.0
_FEWEST = 5  # fewest blocks of a bin; the mean of fewer blocks is noise
_FRICTION_WAVES_TIME = 72  # half waves: up to 3 Hz in 12 s
_FRICTION_WAVES_POSITION = 80  # half waves: down to 5 mm on a stroke of 0.2 m
_FORCE_WAVES = 8  # half waves of a force without direction, which changes slowly
_BINS_PER_WAVE = 4  # bins for each half wave of the shortest wave
# Blocks over which the acceleration is smoothed before it is differentiated. Too small: noise of the encoder looks like a lag.
# Too large: the rate is smeared.
_RATE_WINDOW = 61
_BANDS_HZ = ((3.0, 8.0), (8.0, 24.0))  # above the waves over time, below the noise
_SHORTEST_REST_S = 0.2  # shortest rest whose breakaway counts; shorter rests are reversals


def axis_features(signals: Signals, commands: CommandedRun, rig: RigTable) -> Features:
    """All features of a run with a force drive; `signals` [blocks] each, measured or predicted."""
    features = Features()
    motion = commands.motion
    assert motion is not None, "a force drive has a motion"  # noqa: S101
    rest_N = signals["drive_force_N"] - motion.inertia_N
    _breakaways(features, rest_N, motion, rig.stribeck_velocity_mps)
    inner = slice(_first(motion, rig), len(rest_N) - _EDGE)
    cut = SlideMotion(*(values[inner] for values in motion))
    # a velocity integrated from an acceleration is wrong by some mm/s, too much for the slow bins
    slowest = 0 if "mass_position_m" in signals else len(_SLOW)
    rest_N = _without_curve(features, rest_N[inner], cut, rig.stribeck_velocity_mps, slowest)
    # near a reversal every error of the presliding model would look like a wave
    sliding = np.abs(cut.velocity_mps) > _SLOW[-2] * rig.stribeck_velocity_mps
    rest_N = _without_inertia(features, np.where(sliding, rest_N, 0.0), cut, sliding)
    _waves(features, rest_N, cut, sliding)
    friction_N = rest_N * np.sign(cut.velocity_mps)
    for low_Hz, high_Hz in _BANDS_HZ:
        band = _smooth(friction_N, high_Hz) - _smooth(friction_N, low_Hz)
        power = float(np.var(band[sliding])) if sliding.any() else math.nan
        features.add("ripple", "drive_force_N", "steady", (low_Hz, high_Hz), -1, power)
    if "mass_accel_mps2" in signals and "mass_position_m" in signals:
        accel = signals["mass_accel_mps2"][inner]
        about = cut.accel_mps2 - cut.accel_mps2.mean()
        gain = float(accel @ about) / (float(about @ about) + 1e-12)
        features.add("gain", "mass_accel_mps2", "steady", LOW, -1, gain)
    return features


def friction_share(force_N: Floats, motion: SlideMotion) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """Relative deviation of the friction from its mean at that direction and speed, and the blocks where it is known.

    Both are [blocks]. The deviation is 0 where the slide is too slow.
    """
    rest_N = force_N - motion.inertia_N
    speed = np.abs(motion.velocity_mps)
    edges = np.quantile(speed, np.linspace(0.15, 1.0, 9))
    bins = np.searchsorted(edges, speed, side="right") * 2 + (motion.velocity_mps > 0.0)
    mean = _means(rest_N, bins, int(bins.max()) + 1)[bins]
    valid = (speed > edges[0]) & np.isfinite(mean)
    valid[:_EDGE] = valid[-_EDGE:] = False
    size_N = float(np.abs(mean[valid]).mean())
    return np.where(valid, np.sign(motion.velocity_mps) * (rest_N - mean) / size_N, 0.0), valid


def moving_s(motion: SlideMotion, rig: RigTable) -> float:
    """Time of a run that its features use [s]."""
    if float(np.ptp(motion.position_m)) <= _forgetting_m(rig):
        return 0.0
    return max(len(motion.position_m) - _EDGE - _first(motion, rig), 0) * BLOCK_S


def _forgetting_m(rig: RigTable) -> float:
    return _FORGETTING_LENGTHS * rig.static_force_N / rig.contact_stiffness_N_per_m


def _first(motion: SlideMotion, rig: RigTable) -> int:
    """First block that the features use."""
    travel_m = np.abs(motion.position_m - motion.position_m[0])
    return max(int(np.argmax(travel_m > _forgetting_m(rig))), _EDGE)


def _sums(values: Floats, bins: Indices, count: int) -> tuple[Floats, Indices]:
    """Sum of `values` [blocks] in each bin, and number of blocks in it, [count] each."""
    return np.bincount(bins, values, count).astype(np.float64), np.bincount(bins, minlength=count)


def _means(values: Floats, bins: Indices, count: int) -> Floats:
    """Mean of `values` [blocks] in each bin, [count]; NaN where a bin holds too few blocks."""
    sums, held = _sums(values, bins, count)
    return np.where(held >= _FEWEST, sums / np.maximum(held, 1), np.nan)


def _without_curve(
    features: Features, rest_N: Floats, motion: SlideMotion, stribeck_mps: float, slowest: int
) -> Floats:
    """Add the features of the force over velocity, and return the remainder of the force [blocks].

    A ring is a range of speeds, slowest first; features of rings below the index `slowest` are NaN.
    """
    speed = np.abs(motion.velocity_mps) / stribeck_mps
    fastest = max(float(speed.max()), 1.01 * float(_SLOW[-1]))
    edges = np.concatenate([_SLOW, np.linspace(_SLOW[-1], fastest, _FAST + 1)[1:-1]])
    ring = np.searchsorted(edges, speed, side="right")
    slow = len(_SLOW) - 1  # rings 1 to `slow` have two branches
    forward = motion.velocity_mps > 0.0
    speeding = (motion.accel_mps2 > 0.0) == forward
    # below the first edge the acceleration alone gives the direction
    direction = np.where(ring == 0, motion.accel_mps2 > 0.0, forward)
    branch = np.where((ring > 0) & (ring <= slow), speeding, False)
    bins = ring * 4 + direction * 2 + branch
    count = (len(edges) + 1) * 4
    means = _means(rest_N, bins, count)
    for number in range(len(edges) + 1):
        for side, sign in ((0, "-"), (2, "+")):
            for fork in (0, 1) if 0 < number <= slow else (0,):
                regime = "stick" if number == 0 else "steady" if number > slow else "breakaway" if fork else "restick"
                name = f"friction {sign}{number}{'ab'[fork]}"
                mean_N = float(means[number * 4 + side + fork]) if number >= slowest else math.nan
                features.add(name, "drive_force_N", regime, LOW, -1, mean_N)
    return rest_N - np.nan_to_num(means)[bins]


def _without_inertia(features: Features, rest_N: Floats, motion: SlideMotion, sliding: npt.NDArray[np.bool_]) -> Floats:
    # smoothed more than the motion that the model follows: otherwise the encoder's noise in both would look like a lag
    smooth = uniform_filter1d(uniform_filter1d(motion.accel_mps2, _RATE_WINDOW), _RATE_WINDOW)
    for name, column in (("inertia", motion.accel_mps2), ("lag", np.gradient(smooth, BLOCK_S))):
        about = np.where(sliding, column - column.mean(), 0.0)
        size = math.sqrt(float(about @ about) / max(int(sliding.sum()), 1)) + 1e-12
        about = about / size
        force_N = float(rest_N @ about) / max(int(sliding.sum()), 1)
        features.add(name, "drive_force_N", "slip", LOW, -1, force_N)
        rest_N = rest_N - force_N * about
    return rest_N


def _waves(features: Features, rest_N: Floats, motion: SlideMotion, sliding: npt.NDArray[np.bool_]) -> None:
    time = np.arange(len(rest_N)) / len(rest_N)
    way = motion.position_m - motion.position_m.min()
    way = way / max(float(way.max()), 1e-12)
    friction_N = rest_N * np.sign(motion.velocity_mps)
    for name, over, values, waves in (
        ("friction over time", time, friction_N, _FRICTION_WAVES_TIME),
        ("force over time", time, rest_N, _FORCE_WAVES),
        ("friction over position", way, friction_N, _FRICTION_WAVES_POSITION),
        ("force over position", way, rest_N, _FORCE_WAVES),
    ):
        bins = waves * _BINS_PER_WAVE
        at = np.minimum((over * bins).astype(np.int64), bins - 1)
        sums, held = _sums(values[sliding], at[sliding], bins)
        # shrunk towards 0 in bins with fewer blocks than the median bin: a place that is passed only once shows roughness
        profile = sums / np.maximum(held, max(float(np.median(held)), 1.0))
        weights = np.asarray(dct(profile))[1 : waves + 1] / bins
        for wave, value in enumerate(weights.tolist(), start=1):
            features.add(f"{name} {wave}", "drive_force_N", "steady", LOW, -1, value)


def _breakaways(features: Features, rest_N: Floats, motion: SlideMotion, stribeck_mps: float) -> None:
    """Add the force at which motion starts after a rest, and its slope over the logarithm of the rest."""
    still = np.abs(motion.velocity_mps) < _SLOW[0] * stribeck_mps
    ends = np.flatnonzero(still[:-1] & ~still[1:]) + 1
    begins = np.concatenate([[0] if still[0] else [], np.flatnonzero(~still[:-1] & still[1:]) + 1]).astype(np.int64)
    rests: list[float] = []
    forces: list[float] = []
    for end in ends.tolist():
        begin = int(begins[np.searchsorted(begins, end) - 1])
        if (end - begin) * BLOCK_S >= _SHORTEST_REST_S:
            rests.append(math.log((end - begin) * BLOCK_S))
            sign = float(np.sign(motion.velocity_mps[end]))
            forces.append(float(sign * rest_N[end : end + 20].mean()))
    mean = float(np.mean(forces)) if forces else math.nan
    slope = math.nan
    if len(rests) >= 3 and np.ptp(rests) > 0.3:
        slope = float(np.polyfit(rests, forces, 1)[0])
    features.add("mean", "drive_force_N", "breakaway", LOW, -1, mean)
    features.add("over rest", "drive_force_N", "breakaway", LOW, -1, slope)


def _smooth(values: Floats, frequency_Hz: float) -> Floats:
    """Moving mean of `values` [blocks] that passes half the power at about `frequency_Hz`."""
    return uniform_filter1d(values, max(round(0.44 / (frequency_Hz * BLOCK_S)), 1))
