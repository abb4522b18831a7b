"""The gap, defined once.

A measured run and its prediction are compared feature by feature (`diagnosis.features`), since a sample-by-sample difference of
two stick-slip records measures their phase: 0.1 % more static friction makes it as large as the signal after a few cycles while
every cycle looks the same.

Each difference is divided by its floor: the scatter that the feature shows among replicates of the model itself, which differ
by sensor noise as measured, by the rough surface, and by the age of the contact at the start, and never less than what the
1 ms grid and ordinary sensors can promise. The gap is the root of the mean square of these over cells of signal x regime x
band x run, each cell counting alike, so that a shape of 14 points weighs no more than one mean level:

    gap = sqrt(mean over cells of mean over the cell's features of T(difference / floor)^2) / level,  T(z) = 6 asinh(z / 6)

The level is what the replicates themselves show, so that a perfect model has 1.0. T is the identity up to
a few floors and a logarithm beyond: a drive that ripples by 500 floors of a laser-straight position says no more than one that
ripples by 50, and must not hide everything else.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from diagnosis.gap.floor import KNEE, CellKey, Floor, cell_means, compress, logarithms, slope_of_compress
from diagnosis.gap.problem import Problem

Floats = npt.NDArray[np.floating[Any]]
DEFINITION = (
    "root mean square, over cells of signal x regime x band x run, of the differences between measured and predicted "
    "features (cycle means and trends, slip shapes, levels, vibration, parity relations), each in units of the scatter of "
    "replicates of the model with measured noise and a rough surface; beyond 6 units logarithmic; 1.0 is a perfect model"
)
# Floors, of every feature of a rig that cannot be: more than any other may have. A base too light to compute came out best for a
# log that nothing explains, as what lacks everything had only what lacking costs.
_IMPOSSIBLE = 1e4
_LACKING = 8.0  # floors, of a feature that the rig shows and the model does not: it is far off
# What a slip that the model lacks counts once differences are made independent: more than what slips differ by, or lacking it
# would pay; no more, or there is no way from a model that slips too late. Eight floors for each signal were 690 for one slip.
_LACKING_SLIP = 5.0


def chi2_of(left: Floats) -> float:
    """chi2 of what is left, whitened [compared]."""
    return float(left @ left)


def differences(floor: Floor, problem: Problem, predicted: Floats) -> Floats:
    """Measured less predicted in floors, [compared], not compressed."""
    z = between(floor, predicted, problem.measured)
    return np.where(np.isfinite(z), z, _LACKING)


def whitened(floor: Floor, problem: Problem, predicted: Floats, knee: float = KNEE) -> tuple[Floats, Floats]:
    """Differences compressed and made independent [compared], and the derivative of the compression."""
    if not np.isfinite(predicted).any():
        count = int(floor.compared.sum())
        return np.full(count, _IMPOSSIBLE), np.ones(count)
    z = between(floor, predicted, problem.measured)
    lacking = np.logical_not(np.isfinite(z))
    if lacking.any():
        segments = {run.file: run.commands.segments for run in problem.runs}
        places = [
            (file, label.segment) for (file, label), use in zip(problem.labels, floor.compared, strict=True) if use
        ]
        for file, segment in {place for place, lacks in zip(places, lacking, strict=True) if lacks}:
            own = lacking & np.array([place == (file, segment) for place in places])
            slips = segments[file][segment].slips if segment >= 0 else 1
            z[own] = _LACKING_SLIP * max(slips, 1) ** 0.5 / np.linalg.norm(floor.whitening[:, own].sum(axis=1))
    return floor.whitening @ compress(z, knee), slope_of_compress(z, knee)


def between(floor: Floor, predicted: Floats, seen: Floats) -> Floats:
    """Features as seen [..., features] less predicted ones [features] in floors, [..., compared], NaN where one is missing."""
    apart = logarithms(seen, floor.powers) - floor.expected(predicted)
    return apart[..., floor.compared] / floor.scatter[floor.compared]


def gap(floor: Floor, z: Floats) -> float:
    """The gap of differences `z` [compared], 1.0 for a perfect model."""
    return float(np.sqrt(cell_squares(floor, z).mean())) / floor.level


def cell_squares(floor: Floor, z: Floats) -> Floats:
    """Mean square of the compressed differences `z` [compared] in every cell, in the order of `cell_names`, [cells]."""
    return cell_means(compress(z) ** 2, floor.cells)


def cell_names(floor: Floor) -> tuple[CellKey, ...]:
    """Signal, regime, band and run of every cell."""
    return tuple(dict.fromkeys(floor.cells))
