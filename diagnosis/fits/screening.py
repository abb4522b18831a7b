"""An estimate of the gain of each trial, from one or two predictions: enough to choose the refits, and to begin them.

The nuisances, and the effects that a fit has, move along by one step of their derivatives.
"""

import math
from typing import NamedTuple

import numpy as np

from bridge.arrays import Floats
from diagnosis.fits.fit import Fit, prior_of
from diagnosis.hypotheses.hypothesis import Hypothesis
from diagnosis.hypotheses.starts import Trial

# Bounds of a screened start: times the trial's own size, and tolerances of a nuisance. Too small: large effects look too small
# to matter. Too large: starts lie where the derivatives no longer hold.
_FURTHEST = 8.0
_FURTHEST_TOLERANCES = 3.0
_LEAST_POWER = 1e-6  # of a direction, in chi2: less changes nothing


class Screened(NamedTuple):
    """A start of a refit, and the chi2 that it promises."""

    hypothesis: Hypothesis  # the trial's effects, after the effects of the fit that the trial is added to
    deviations: Floats  # start of the nuisances, in tolerances [nuisances]
    w: Floats  # start of the coordinates [coordinates]
    chi2: float
    before: tuple[Floats, Floats]  # deviations and coordinates from which the nuisances have moved


class Screening:
    """Starts on top of a fit, whose nuisances and coordinates move along."""

    def __init__(self, fit: Fit) -> None:
        self._fit = fit
        self._held = prior_of(fit.hypothesis, fit.deviations)
        self._columns = np.vstack([fit.columns, np.diag(self._held)])
        self._inverse = np.linalg.pinv(self._columns)

    def promised(self, trial: Trial, change: Floats) -> Screened | None:
        """A trial at the size of the lowest chi2, if all were linear; None where it changes nothing.

        Args:
            trial: the effect to add.
            change: of the whitened differences by the trial [compared].

        """
        fit, at = self._fit, np.concatenate([self._fit.deviations, self._fit.w])
        full = np.concatenate([change, np.zeros(len(at))])
        direction = full - self._columns @ (self._inverse @ full)
        power = float(direction @ direction)
        if power < _LEAST_POWER:
            return None
        rest = np.concatenate([fit.residual, -self._held * at])
        first = trial.hypothesis.coordinates[0]
        size = float(direction @ rest) / power
        size = min(max(size, 1.0 / _FURTHEST if first.logarithmic else -_FURTHEST), _FURTHEST)
        w = trial.w.copy()
        if first.logarithmic:
            w[0] += (-0.5 if first.name in {"corner_Hz", "resonance_Hz"} else 1.0) * math.log(size)  # larger is less
        else:
            w[0] *= size
        hypothesis = Hypothesis(
            fit.hypothesis.forms | trial.hypothesis.forms, (*fit.hypothesis.coordinates, *trial.hypothesis.coordinates)
        )
        return self.eased(hypothesis, fit.deviations, np.concatenate([fit.w, w]), fit.residual - size * change)

    def eased(self, hypothesis: Hypothesis, deviations: Floats, w: Floats, residual: Floats) -> Screened:
        """A start after one step of the nuisances and of the fit's own effects.

        Args:
            hypothesis: the fit's effects, and further ones.
            deviations: of the nuisances at the start, in tolerances [nuisances].
            w: coordinates at the start [coordinates].
            residual: whitened differences at the start [compared].

        """
        count = len(deviations)
        at, added = np.concatenate([deviations, w[: len(self._fit.w)]]), w[len(self._fit.w) :]
        rest = np.concatenate([residual, -self._held * at])
        moved = at + self._inverse @ rest
        moved[:count] = np.clip(moved[:count], -_FURTHEST_TOLERANCES, _FURTHEST_TOLERANCES)
        left = rest - self._columns @ (moved - at)
        held = prior_of(hypothesis, deviations)[len(at) :] * added
        chi2 = float(left @ left + held @ held)
        return Screened(hypothesis, moved[:count], np.concatenate([moved[count:], added]), chi2, (deviations, w))
