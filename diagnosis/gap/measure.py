"""Definition of the gap.

A measured run and its prediction are compared feature by feature (`diagnosis.features`). A sample-by-sample difference of two
stick-slip records measures their phase: with 0.1 % more static friction this difference is as large as the signal after a few
cycles, while every cycle looks the same.

Each difference is divided by its noise floor. The floor is the scatter of the feature among replicates of the model: they differ
by measured sensor noise, by the rough surface, and by the age of the contact at the start. The floor is never below the
resolution of the 1 ms grid and the accuracy of ordinary sensors. The gap is the root mean square of the differences over cells of
signal x regime x band x run. Each cell has the same weight, so a shape of 14 points weighs no more than one mean level:

    gap = sqrt(mean over cells of mean over the cell's features of T(difference / floor)^2) / level,  T(z) = 6 asinh(z / 6)

The level is the same root for the replicates, so a perfect model has the gap 1.0. T is the identity up to a few floors and a
logarithm beyond: a ripple of 500 floors in a very accurate drive position proves no more than a ripple of 50 floors, and must not
hide all other differences.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.arrays import Floats
from diagnosis.features.feature import DRIVE_WAVES, POWERS, Feature
from diagnosis.gap.problem import Draw, Point, Problem
from diagnosis.model.rig import Roughness
from diagnosis.model.sensor_chain import BEND_S2

# Difference, in noise floors, up to which it counts in full; beyond, it counts as its logarithm.
# Too small: large differences, which identify the effect, count little. Too large: a signal that is far off hides all others.
KNEE = 6.0
_LEAST_POWER = 1e-30  # squared unit of the signal: keeps the logarithm of a power finite; far below any sensor's noise
_SHORT_WAVES = frozenset(f"wave {number}" for number in range(5, DRIVE_WAVES + 1))  # shorter than a sensor's bow
# Share of the replicates in which a feature must be finite to be compared.
# Too small: its scatter comes from few replicates. Too large: features of segments with few slips are lost.
_FEWEST_FINITE = 0.75
CellKey = tuple[str, str, tuple[float, float], str]
DEFINITION = (
    "root mean square, over cells of signal x regime x band x run, of the differences between measured and predicted "
    "features (cycle means and trends, slip shapes, levels, vibration, parity relations), each in units of the scatter of "
    "replicates of the model with measured noise and a rough surface; beyond 6 units logarithmic; 1.0 is a perfect model"
)
# Difference, in noise floors, of every feature of a rig that cannot be simulated: larger than any other difference.
# Too small: an impossible rig, which has no features to differ in, beats possible rigs (docs/method/diagnosis.md).
_IMPOSSIBLE = 1e4
# Difference, in noise floors, of a feature that the rig shows and the model does not; in a fit, of each slip (after whitening).
# Too small: models that lose slips win. Too large: a fit that starts with late slips cannot recover.
# Counted on one late slip (docs/method/diagnosis.md).
LACKING = 5.0


class Floor(NamedTuple):
    """The noise floor of each feature.

    The features belong to one `Problem`. Arrays are [features], in the unit of each feature, unless stated otherwise.
    """

    bias: Floats  # mean of the replicates less the noise-free prediction; 0 or more for powers
    powers: npt.NDArray[np.bool_]  # features that are powers: noise adds to them, and they are compared as logarithms
    scatter: Floats  # one noise floor; of the logarithm for powers
    compared: npt.NDArray[np.bool_]
    whitening: Floats  # [compared, compared]: makes differences of replicates independent
    cells: tuple[CellKey, ...]  # [compared]: the cell of every compared feature
    level: float  # root mean square of the replicates themselves over the cells, in noise floors

    def expected(self, predicted: Floats) -> Floats:
        """Expected features of a rough and noisy rig whose noise-free prediction is `predicted`; [features] each.

        A power is returned as half its logarithm.
        """
        return logarithms(predicted + self.bias, self.powers)


def compress(z: Floats, knee: float = KNEE) -> Floats:
    """Function T of the definition of the gap, of `z` in noise floors; fits begin with a larger knee."""
    return knee * np.arcsinh(z / knee)


def slope_of_compress(z: Floats, knee: float = KNEE) -> Floats:
    """Derivative of `compress` at `z`, same shape."""
    return 1.0 / np.sqrt(1.0 + (z / knee) ** 2)


def replicates(
    problem: Problem,
    point: Point,
    roughness: Roughness,
    count: int,
    seed: int,
    perhaps: Sequence[Point] = (),
) -> Floats:
    """Predicted features of a model on random rough surfaces with random sensor noise, [count, features].

    Args:
        problem: the runs.
        point: the model.
        roughness: scatter of the friction, and the length around which the length of each replicate is drawn.
        count: number of replicates.
        seed: seed of the draws.
        perhaps: points that may be requested next, simulated where a lane is free.

    """
    draws: list[Draw] = []
    for number in range(count):
        random = np.random.default_rng([seed, number])
        length_m = float(roughness.length_m * np.exp(random.uniform(-1.0, 1.0)))
        surface = Roughness(roughness.ratio, length_m, int(random.integers(1_000_000)))
        draws.append(Draw(random, surface))
    return np.array(problem.predicted_many([point] * count, draws, perhaps))


def floor_of(problem: Problem, point: Point, drawn: Floats, before: Floor | None = None) -> Floor:
    """The noise floor of the model at `point`, from its replicates `drawn` [count, features].

    A feature that the floor `before` compared stays compared, with the scatter of `before`: a refit that loses the slips
    cannot drop the features of the slips.
    """
    labels = problem.labels
    powers = np.array([label.name in POWERS for _, label in labels])
    plain = problem.predicted(point)
    finite = np.isfinite(drawn)
    compared = (finite.mean(axis=0) >= _FEWEST_FINITE) & np.isfinite(plain) & np.isfinite(problem.measured)
    count = np.maximum(finite.sum(axis=0), 1)
    mean = np.where(finite, drawn, 0.0).sum(axis=0) / count
    bias = np.where(compared, mean - np.where(compared, plain, 0.0), 0.0)
    # Noise can only increase a power, so a negative bias is chance. Added to the prediction of a weaker ring, it would give a
    # negative power, whose logarithm is far off (docs/method/diagnosis.md).
    bias[powers] = np.maximum(bias[powers], 0.0)
    about = np.where(finite, logarithms(drawn, powers) - logarithms(mean, powers), 0.0)
    # Under vibration a slip depends on the phase at which it begins. So the prediction scatters as much as the measured run,
    # and the variance of their difference is twice the variance of the replicates.
    about *= np.where(_slips_under_vibration(problem), 2.0**0.5, 1.0)
    spread = np.sqrt((about * about).sum(axis=0) / np.maximum(count - 1, 1))
    least = np.array([_least(label, problem) for _, label in labels])
    scatter = np.hypot(spread, least)
    lost = np.zeros_like(compared)
    if before is not None:
        lost = before.compared & ~compared
        compared = compared | lost
        bias, scatter = np.where(lost, before.bias, bias), np.where(lost, before.scatter, scatter)
    z = compress(about[:, compared] / scatter[compared])
    cells = tuple(
        (label.signal, label.regime, label.band_Hz, file)
        for (file, label), use in zip(labels, compared, strict=True)
        if use
    )
    # The replicates show only the drawn part of the scatter; the whitening needs the least scatter as well.
    further = np.where(lost, 1.0, least / scatter)[compared] ** 2
    # A new run differs from the mean of `count` replicates by a little more than the replicates do.
    correction = (len(drawn) + 1.0) / (len(drawn) - 1.0)
    squares = np.where(lost[compared], 1.0, z * z)
    # without a cell the model shows none of the measured features; the caller reports it
    level = np.sqrt(correction * np.mean([cell_means(row, cells).mean() for row in squares])) if cells else np.nan
    segments = [(file, label.segment) for (file, label), use in zip(labels, compared, strict=True) if use]
    return Floor(bias, powers, scatter, compared, _whitening(z, further, segments), cells, float(level))


def logarithms(values: Floats, powers: npt.NDArray[np.bool_]) -> Floats:
    """Features [..., features] with each power as half its logarithm; other features unchanged.

    A difference of two powers is then the relative difference of two amplitudes.
    """
    return np.where(powers, 0.5 * np.log(np.maximum(values, _LEAST_POWER)), values)


def _slips_under_vibration(problem: Problem) -> npt.NDArray[np.bool_]:
    segments = {run.file: run.commands.segments for run in problem.runs}
    return np.array(
        [
            label.segment >= 0 and label.regime != "steady" and segments[file][label.segment].frequency_Hz > 0.0
            for file, label in problem.labels
        ]
    )


def cell_means(squares: Floats, cells: tuple[CellKey, ...]) -> Floats:
    """Mean of `squares` [compared] over the features of each cell, [cells], in the order in which the cells first appear."""
    number = {key: i for i, key in enumerate(dict.fromkeys(cells))}
    index = np.array([number[key] for key in cells], np.int64)
    return np.bincount(index, squares, len(number)) / np.bincount(index, minlength=len(number))


def _whitening(z: Floats, further: Floats, segments: list[tuple[str, int]]) -> Floats:
    """Inverse root of the covariance of the replicates `z` [count, compared], segment by segment.

    Each segment runs on another piece of the track. With so few replicates, a correlation of two segments is chance, and a
    shrinkage strong enough to remove it would also remove the common effect of a slip on all features of its segment.
    """
    result = np.zeros((len(segments), len(segments)))
    for segment in dict.fromkeys(segments):
        mask = np.array([label == segment for label in segments])
        result[np.outer(mask, mask)] = _inverse_root(z[:, mask], further[mask]).ravel()
    return result


def _inverse_root(z: Floats, further: Floats) -> Floats:
    """Inverse root of the covariance of the replicates `z` [count, features], shrunk towards independence.

    The intensity of the shrinkage follows Ledoit and Wolf (2004). `further` [features] is added to the variances.
    """
    count, features = z.shape
    sample = z.T @ z / count
    off = sample - np.diag(np.diag(sample))
    square = z * z
    noise = float((square.T @ square).sum() / count - (sample**2).sum()) - float(
        ((square**2).sum(axis=0) / count - np.diag(sample) ** 2).sum()
    )
    shrink = float(np.clip(noise / count / max(float((off**2).sum()), 1e-12), 0.05, 1.0))
    covariance = (1.0 - shrink) * off
    covariance[np.diag_indices(features)] = np.maximum(np.diag(sample) + further, 0.3)
    values, vectors = np.linalg.eigh(covariance)
    return (vectors / np.sqrt(np.maximum(values, 0.05))) @ vectors.T


def _least(label: Feature, problem: Problem) -> float:
    """Smallest scatter of a feature, in the unit of the feature: resolution of the grid and accuracy of ordinary sensors.

    A smaller value makes false gaps from ordinary sensors; a larger value hides small effects in that feature. A number
    without a comment was set so that synthetic evidence without a gap differs by one to two noise floors (rms over eight
    evidences of the protocol "ladder").
    """
    force_N, slip_s, _, stiffness, _ = problem.scales
    if problem.rig.drive == "force":
        return _least_of_axis(label, force_N, problem.force_peak_N)
    drop_m = 0.3 * force_N / stiffness  # length of a slip when friction falls by a sixth
    accel_mps2 = drop_m * (np.pi / slip_s) ** 2
    jumps = label.name in {"shape -0.5", "shape 0.5"}  # the acceleration jumps where a slip begins and where it ends
    by_name = {
        "rest": 1.5,  # noise of a displacement sensor between 5 and 24 Hz cannot be estimated from the run
        "scatter": 0.6,  # small powers: hum, slow noise and the roughness of a track are as large
        "ripple": 0.6,
        "ring": 0.25,
        "spring rest": 0.25,
        "spring cube": 8e-3
        * force_N,  # over a short stretch the bow of a displacement sensor looks like a stiffening spring
        "spring bend": BEND_S2 * stiffness,
        "period": 0.003,
    }
    by_first_word = {
        "spring": 2e-3 * force_N,  # a bow of 0.2 % in a displacement sensor changes the slope along the track
        "vibration": 0.006 if label.signal == "base_accel_mps2" else 0.04,
        "rate": 0.003 * force_N,
    }
    by_signal = {
        "drive_force_N": 3e-4 * force_N,
        "mass_accel_mps2": (0.1 if jumps else 4e-3) * accel_mps2,
        "base_accel_mps2": (0.1 if jumps else 4e-3) * accel_mps2,
        # a sensor's bow appears in the long waves; over a short way its error is small
        "drive_position_m": (4e-4 if label.name in _SHORT_WAVES else 2e-3) * drop_m,
        "mass_position_m": 1e-3 * drop_m,
    }
    return by_name.get(label.name) or by_first_word.get(label.name.split()[0]) or by_signal[label.signal]


def _least_of_axis(label: Feature, force_N: float, peak_N: float) -> float:
    if label.name == "ripple":
        return 0.2
    if label.signal != "drive_force_N":
        return 0.002
    if label.regime == "breakaway" and label.name in {"mean", "over rest"}:
        return 0.02 * force_N  # the load on the contact before the run is not known
    if " over " in label.name:
        return 2e-4 * force_N  # waves over time and position: the error of a force channel changes slowly
    return 5e-4 * peak_N  # linearity of a good force channel


def chi2_of(left: Floats) -> float:
    """chi2 of the whitened differences `left` [compared]."""
    return float(left @ left)


def differences(floor: Floor, problem: Problem, predicted: Floats) -> Floats:
    """Measured less predicted features, in noise floors, [compared], not compressed.

    `predicted` is [features]; a measured feature without a prediction counts as `LACKING`.
    """
    z = between(floor, predicted, problem.measured)
    return np.where(np.isfinite(z), z, LACKING)


def whitened(floor: Floor, problem: Problem, predicted: Floats, knee: float = KNEE) -> tuple[Floats, Floats]:
    """Differences of measured and predicted features, compressed and made independent; and the derivative of the compression.

    Both are [compared]. Slips that the prediction lacks are penalised by segment, see `LACKING`.

    Args:
        floor: the noise floor of `problem`.
        problem: the measured runs.
        predicted: features of the model, [features]; all NaN for a rig that cannot be simulated.
        knee: difference, in noise floors, beyond which its logarithm counts.

    """
    if not np.isfinite(predicted).any():
        count = int(floor.compared.sum())
        return np.full(count, _IMPOSSIBLE), np.ones(count)
    z = between(floor, predicted, problem.measured)
    lacking = np.logical_not(np.isfinite(z))
    if lacking.any():
        places = problem.place[floor.compared]
        for place in np.unique(places[lacking]).tolist():
            mask = lacking & (places == place)
            slips = max(problem.slips[place], 1)
            z[mask] = LACKING * slips**0.5 / np.linalg.norm(floor.whitening[:, mask].sum(axis=1))
    return floor.whitening @ compress(z, knee), slope_of_compress(z, knee)


def between(floor: Floor, predicted: Floats, seen: Floats) -> Floats:
    """Features `seen` [..., features] less `predicted` [features], in noise floors, [..., compared].

    NaN where one of the two is missing.
    """
    apart = logarithms(seen, floor.powers) - floor.expected(predicted)
    return apart[..., floor.compared] / floor.scatter[floor.compared]


def gap(floor: Floor, z: Floats) -> float:
    """The gap of the differences `z` [compared] in noise floors; 1.0 for a perfect model."""
    return float(np.sqrt(cell_squares(floor, z).mean())) / floor.level


def cell_squares(floor: Floor, z: Floats) -> Floats:
    """Mean square of the compressed differences `z` [compared] of each cell, [cells], in the order of `cell_names`."""
    return cell_means(compress(z) ** 2, floor.cells)


def cell_names(floor: Floor) -> tuple[CellKey, ...]:
    """Signal, regime, band [Hz] and run of each cell, [cells]."""
    return tuple(dict.fromkeys(floor.cells))
