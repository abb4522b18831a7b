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

import numpy as np

from bridge.arrays import Floats
from diagnosis.gap.floor import KNEE, CellKey, Floor, cell_means, compress, logarithms, slope_of_compress
from diagnosis.gap.problem import Problem

DEFINITION = (
    "root mean square, over cells of signal x regime x band x run, of the differences between measured and predicted "
    "features (cycle means and trends, slip shapes, levels, vibration, parity relations), each in units of the scatter of "
    "replicates of the model with measured noise and a rough surface; beyond 6 units logarithmic; 1.0 is a perfect model"
)
# Difference, in noise floors, of every feature of a rig that cannot be simulated: larger than any other difference.
# Too small: an impossible rig, which has no features to differ in, beats possible rigs (docs/method/diagnosis.md).
_IMPOSSIBLE = 1e4
# Difference, in noise floors, of a feature that the rig shows and the model does not; only for the reported gap.
# Too small: a model without slips seems good. Too large: it has little effect, as T is a logarithm there.
_LACKING = 8.0
# Penalty, in noise floors, for a measured slip that the model does not show (after whitening, so each slip counts once).
# Too small: models that lose slips win. Too large: a fit that starts with late slips cannot recover.
# Counted on one late slip (docs/method/diagnosis.md).
_LACKING_SLIP = 5.0


def chi2_of(left: Floats) -> float:
    """chi2 of the whitened differences `left` [compared]."""
    return float(left @ left)


def differences(floor: Floor, problem: Problem, predicted: Floats) -> Floats:
    """Measured less predicted features, in noise floors, [compared], not compressed.

    `predicted` is [features]; a measured feature without a prediction counts as `_LACKING`.
    """
    z = between(floor, predicted, problem.measured)
    return np.where(np.isfinite(z), z, _LACKING)


def whitened(floor: Floor, problem: Problem, predicted: Floats, knee: float = KNEE) -> tuple[Floats, Floats]:
    """Differences of measured and predicted features, compressed and made independent; and the derivative of the compression.

    Both are [compared]. Slips that the prediction lacks are penalised by segment, see `_LACKING_SLIP`.

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
            z[mask] = _LACKING_SLIP * slips**0.5 / np.linalg.norm(floor.whitening[:, mask].sum(axis=1))
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
