"""The noise floor: what a perfect model would still show."""

from collections.abc import Sequence
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from diagnosis.features.feature import DRIVE_WAVES, POWERS, Feature
from diagnosis.gap.problem import Draw, Point, Problem
from diagnosis.model.rig import Roughness
from diagnosis.processes import each

Floats = npt.NDArray[np.floating[Any]]

KNEE = 6.0
_LEAST_POWER = 1e-30
# Of the force over the extension, as T^2 of a delay: of 20 rigs without a gap a run shows 0.16 ms2 (rms), 1.5 floors so, where
# replicates with their noise promise 0.07; displacement channels that lag by 0.28 ms, of any order, are good for 0.04.
_SENSORS_BEND_S2 = 1e-7
_SHORT_WAVES = frozenset(f"wave {number}" for number in range(5, DRIVE_WAVES + 1))
_FEWEST_FINITE = 0.75  # of the replicates, or a feature is not compared
CellKey = tuple[str, str, tuple[float, float], str]


class Floor(NamedTuple):
    """What a perfect model would still show, feature by feature. [features] each, of the problem it was made for."""

    bias: Floats  # mean of the replicates less the noise-free prediction; of powers never below 0
    powers: npt.NDArray[np.bool_]  # features that are powers: noise adds to them, and they are compared as logarithms
    scatter: Floats
    compared: npt.NDArray[np.bool_]
    whitening: Floats  # [compared, compared]: makes differences of replicates independent
    cells: tuple[CellKey, ...]  # of every compared feature
    level: float  # gap of the replicates themselves

    def expected(self, predicted: Floats) -> Floats:
        """A noise-free prediction [features] as a rough and noisy rig would show it on average."""
        return logarithms(predicted + self.bias, self.powers)

    def of_features(self, own: npt.NDArray[np.bool_]) -> "Floor":
        """The floor of some features [features], which are those of whole runs: runs are independent of each other."""
        rows = own[self.compared]
        return Floor(
            bias=self.bias[own],
            powers=self.powers[own],
            scatter=self.scatter[own],
            compared=self.compared[own],
            whitening=self.whitening[rows][:, rows],
            cells=tuple(cell for cell, is_own in zip(self.cells, rows, strict=True) if is_own),
            level=self.level,
        )


def compress(z: Floats, knee: float = KNEE) -> Floats:
    """T of the definition; fits begin with a larger knee."""
    return knee * np.arcsinh(z / knee)


def slope_of_compress(z: Floats, knee: float = KNEE) -> Floats:
    """Its derivative."""
    return 1.0 / np.sqrt(1.0 + (z / knee) ** 2)


def replicates(
    problem: Problem,
    point: Point,
    roughness: Roughness,
    count: int,
    seed: int,
    jobs: int = 1,
    perhaps: Sequence[Point] = (),
) -> Floats:
    """Runs of one model on other surfaces with other noise, [count, features]; the same ones in any number of processes.

    `perhaps` are points that will be asked for next.
    """
    shares = np.array_split(np.arange(count), jobs)
    drawn = each(jobs, _drawn, problem, [(point, roughness, seed, share.tolist(), perhaps) for share in shares])
    return np.array(list(chain.from_iterable(drawn)))


def _drawn(problem: Problem, share: tuple[Point, Roughness, int, list[int], Sequence[Point]]) -> list[Floats]:
    point, roughness, seed, numbers, perhaps = share
    draws: list[Draw] = []
    for number in numbers:
        random = np.random.default_rng([seed, number])
        length_m = float(roughness.length_m * np.exp(random.uniform(-1.0, 1.0)))
        surface = Roughness(roughness.ratio, length_m, int(random.integers(1_000_000)))
        draws.append(Draw(random, surface))
    return problem.predicted_many([point] * len(draws), draws, perhaps)


def floor_of(problem: Problem, point: Point, drawn: Floats, before: Floor | None = None) -> Floor:
    """The floor from replicates of the model at `point`, [count, features].

    What a floor `before` compared stays compared, with its scatter: a refit that loses the slips does not lose their features.
    """
    labels = problem.labels
    powers = np.array([label.name in POWERS for _, label in labels])
    plain = problem.predicted(point)
    finite = np.isfinite(drawn)
    compared = (finite.mean(axis=0) >= _FEWEST_FINITE) & np.isfinite(plain) & np.isfinite(problem.measured)
    count = np.maximum(finite.sum(axis=0), 1)
    mean = np.where(finite, drawn, 0.0).sum(axis=0) / count
    bias = np.where(compared, mean - np.where(compared, plain, 0.0), 0.0)
    # noise adds to a power: where the noise-free one is above the mean by chance, taking that off leaves less than nothing
    # of a ring a fifth as strong, and one feature left 2760 of chi2
    bias[powers] = np.maximum(bias[powers], 0.0)
    about = np.where(finite, logarithms(drawn, powers) - logarithms(mean, powers), 0.0)
    # under vibration the phase at which a slip begins decides how it goes: the prediction is one draw, as the rig is
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
    # the least scatter is as much a part of the floor as the drawn one: what of it the replicates do not show is added
    promised = np.where(lost, 1.0, least / scatter)[compared] ** 2
    # a run of its own differs from the mean of so many others by a little more than they do among themselves
    others = (len(drawn) + 1.0) / (len(drawn) - 1.0)
    squares = np.where(lost[compared], 1.0, z * z)
    level = np.sqrt(others * np.mean([cell_means(row, cells).mean() for row in squares]))
    segments = [(file, label.segment) for (file, label), use in zip(labels, compared, strict=True) if use]
    return Floor(bias, powers, scatter, compared, _whitening(z, promised, segments), cells, float(level))


def logarithms(values: Floats, powers: npt.NDArray[np.bool_]) -> Floats:
    """Powers as half their logarithm, so that a difference is a relative one of amplitudes; the rest as it is."""
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
    """Means of squares over the features of each cell, in the order in which cells first appear."""
    number = {key: i for i, key in enumerate(dict.fromkeys(cells))}
    index = np.array([number[key] for key in cells], np.int64)
    return np.bincount(index, squares, len(number)) / np.bincount(index, minlength=len(number))


def _whitening(z: Floats, promised: Floats, segments: list[tuple[str, int]]) -> Floats:
    """Inverse root of the replicates' covariance, segment by segment: each begins anew on its own piece of the track.

    Where so few replicates show a correlation of two segments it is by chance, and shrinking that away takes along what a slip
    does to all features of its segment.
    """
    result = np.zeros((len(segments), len(segments)))
    for segment in dict.fromkeys(segments):
        own = np.array([one == segment for one in segments])
        result[np.outer(own, own)] = _inverse_root(z[:, own], promised[own]).ravel()
    return result


def _inverse_root(z: Floats, promised: Floats) -> Floats:
    """Of the covariance of replicates [count, features], shrunk towards independence (Ledoit and Wolf's intensity)."""
    count, features = z.shape
    sample = z.T @ z / count
    off = sample - np.diag(np.diag(sample))
    square = z * z
    noise = float((square.T @ square).sum() / count - (sample**2).sum()) - float(
        ((square**2).sum(axis=0) / count - np.diag(sample) ** 2).sum()
    )
    shrink = float(np.clip(noise / count / max(float((off**2).sum()), 1e-12), 0.05, 1.0))
    covariance = (1.0 - shrink) * off
    covariance[np.diag_indices(features)] = np.maximum(np.diag(sample) + promised, 0.3)
    values, vectors = np.linalg.eigh(covariance)
    return (vectors / np.sqrt(np.maximum(values, 0.05))) @ vectors.T


def _least(label: Feature, problem: Problem) -> float:
    """The scatter that a feature has at least, in its own unit: the grid's resolution and what ordinary sensors promise.

    Where no such promise is named beside it, a number is set so that evidence made from the plant without a gap differs by one
    to two floors (rms over eight such evidences of the protocol "ladder").
    """
    force_N, slip_s, _, stiffness, _ = problem.scales
    if problem.rig.drive == "force":
        return _least_of_axis(label, force_N, problem.force_peak_N)
    drop_m = 0.3 * force_N / stiffness  # of a slip, for friction that falls by a sixth
    if label.name == "rest":
        return 1.5  # of a displacement sensor between 5 and 24 Hz, where no piece of its noise can be had
    if label.name in {"scatter", "ripple"}:
        return 0.6  # small powers, which hum, slow noise and the roughness of one track reach
    if label.name in {"ring", "spring rest"}:
        return 0.25
    if label.name == "spring cube":
        return 8e-3 * force_N  # nor can such a bow be told from a bend of the spring over a short stretch
    if label.name == "spring bend":
        return _SENSORS_BEND_S2 * stiffness
    if label.name.startswith("spring"):
        return 2e-3 * force_N  # a displacement sensor's bow of 0.2 % changes its slope along the track
    if label.name.startswith("vibration"):
        return 0.006 if label.signal == "base_accel_mps2" else 0.04
    if label.name == "period":
        return 0.003
    if label.name.startswith("rate"):
        return 0.003 * force_N
    if label.signal == "drive_force_N":
        return 3e-4 * force_N
    if label.signal.endswith("accel_mps2"):
        if label.name in {"shape -0.5", "shape 0.5"}:  # where a slip begins and ends the acceleration jumps
            return 0.1 * drop_m * (np.pi / slip_s) ** 2
        return 4e-3 * drop_m * (np.pi / slip_s) ** 2
    if label.signal == "drive_position_m":  # a sensor's bow is slow; its errors over a short way are small
        return (4e-4 if label.name in _SHORT_WAVES else 2e-3) * drop_m
    return 1e-3 * drop_m


def _least_of_axis(label: Feature, force_N: float, peak_N: float) -> float:
    if label.name == "ripple":
        return 0.2
    if label.signal != "drive_force_N":
        return 0.002
    if label.regime == "breakaway" and label.name in {"mean", "over rest"}:
        return 0.02 * force_N  # how far the contact was loaded before the run is not known
    if " over " in label.name:
        return 2e-4 * force_N
    return 5e-4 * peak_N  # the linearity of a good force channel
