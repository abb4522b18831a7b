"""Fitting the model to the measured features: nuisances inside their tolerances, and the parameters of an effect.

Gauss-Newton in whitened, compressed differences. The nuisances' columns are computed once where the rig was retuned; an effect's
own columns at every step, since effects are as nonlinear as a gap that opens or a wave that passes.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from diagnosis.gap import Floor, compress, differences, slope_of_compress
from diagnosis.nuisance import Nuisances
from diagnosis.problem import Problem
from diagnosis.twin import Effects
from plant.effects import EFFECTS

Floats = npt.NDArray[np.float64]
_STEP = 0.5  # of a tolerance: large against the grid, small against the curvature
_MOST_TOLERANCES = 4.0


class Axis(NamedTuple):
    """One parameter of an effect as a coordinate: value = scale * w, or scale * exp(w) where it must stay positive."""

    effect: str
    name: str
    scale: float
    logarithmic: bool
    prior: float  # standard deviation of w
    low: float
    high: float

    def value(self, w: float) -> float:
        """The parameter's value, within its bounds."""
        raw = self.scale * math.exp(min(max(w, -30.0), 30.0)) if self.logarithmic else self.scale * w
        return min(max(raw, self.low), self.high)


class Form(NamedTuple):
    """Effects in given formulas with their free parameters; the others are held."""

    forms: dict[str, str]  # effect -> form
    axes: tuple[Axis, ...]

    @property
    def effects(self) -> tuple[str, ...]:
        """Names."""
        return tuple(self.forms)

    def tables(self, w: Floats) -> Effects:
        """As a rig file would have them."""
        tables: Effects = {name: {"form": form} for name, form in self.forms.items()}
        for axis, coordinate in zip(self.axes, w.tolist(), strict=True):
            tables[axis.effect][axis.name] = axis.value(coordinate)
        for name, form in self.forms.items():
            for parameter in EFFECTS[name].forms[form].parameters:
                tables[name].setdefault(parameter.name, parameter.default)
        return tables


NOTHING = Form({}, ())


class Fit(NamedTuple):
    """A model fitted to the measured features of a problem."""

    form: Form
    deviations: Floats  # of the nuisances, in tolerances [nuisances]
    w: Floats  # [axes]
    chi2: float  # with the priors' terms
    residual: Floats  # whitened [compared]
    columns: Floats  # whitened derivatives, nuisances then axes [compared, nuisances + axes]

    @property
    def effects(self) -> Effects:
        """The effects of the model as tables of a rig file."""
        return self.form.tables(self.w)

    def covariance(self) -> Floats:
        """Of nuisances and axes together, from the columns and the priors."""
        prior = np.concatenate([np.ones(len(self.deviations)), [axis.prior**-2 for axis in self.form.axes]])
        return np.linalg.inv(self.columns.T @ self.columns + np.diag(prior))


class Fitter:
    """Fits forms to one problem under one floor."""

    def __init__(self, problem: Problem, floor: Floor, nuisances: Nuisances) -> None:
        self.problem = problem
        self.floor = floor
        self.nuisances = nuisances
        self._nuisance_columns: Floats | None = None

    def predicted(self, deviations: Floats, effects: Effects) -> Floats:
        """Features of the model, [features]."""
        return self.problem.predicted(self.nuisances.point(deviations, effects))

    def whitened(self, predicted: Floats) -> tuple[Floats, Floats]:
        """Whitened compressed differences [compared], and the derivative of the compression there."""
        z = differences(self.floor, self.problem, predicted)
        return self.floor.whitening @ compress(z), slope_of_compress(z)

    def column(self, change: Floats, slope: Floats) -> Floats:
        """A change of the prediction [features] as a column of derivatives of the whitened prediction."""
        z = change[self.floor.compared] / self.floor.scatter[self.floor.compared] * slope
        return self.floor.whitening @ np.where(np.isfinite(z), z, 0.0)

    def retuned(self, deviations: Floats, steps: int = 3) -> Fit:
        """The rig without effects, refitted; derivatives are computed at the end point."""
        fit = self.fit(NOTHING, deviations, np.zeros(0), steps=1, renew=True)
        for _ in range(steps - 1):
            before = fit.chi2
            fit = self.fit(NOTHING, fit.deviations, np.zeros(0), steps=2, renew=True)
            if before - fit.chi2 < 1.0:
                break
        return fit

    def fit(self, form: Form, deviations: Floats, w: Floats, steps: int = 4, renew: bool = False) -> Fit:
        """Fit a form from a starting point."""
        here = self.predicted(deviations, form.tables(w))
        residual, slope = self.whitened(here)
        chi2 = self._chi2(form, residual, deviations, w)
        own = len(deviations)
        raw: Floats | None = None
        prior = np.concatenate([np.ones(own), [1.0 / axis.prior for axis in form.axes]])
        columns = np.zeros((len(residual), own + len(w)))
        for step in range(steps + 1):
            if renew or self._nuisance_columns is None:
                self._nuisance_columns = self._derivatives(deviations, form.tables(w), here)
                renew = False
            raw = np.column_stack([self._nuisance_columns, self._axis_derivatives(form, deviations, w, here)])
            columns = np.column_stack([self.column(raw[:, i], slope) for i in range(raw.shape[1])])
            if step == steps:
                break
            now = np.concatenate([deviations, w])
            normal = columns.T @ columns + np.diag(prior**2)
            change = np.linalg.solve(normal, columns.T @ residual - prior**2 * now)
            gained = False
            for share in (1.0, 0.4, 0.1):
                ahead = now + share * change
                ahead[:own] = np.clip(ahead[:own], -_MOST_TOLERANCES, _MOST_TOLERANCES)
                try_residual_at = self.predicted(ahead[:own], form.tables(ahead[own:]))
                try_residual, try_slope = self.whitened(try_residual_at)
                try_chi2 = self._chi2(form, try_residual, ahead[:own], ahead[own:])
                if try_chi2 < chi2 - 1e-9:
                    gain = chi2 - try_chi2
                    deviations, w = ahead[:own], ahead[own:]
                    here, residual, slope, chi2 = try_residual_at, try_residual, try_slope, try_chi2
                    gained = gain > 0.3
                    break
            if not gained:
                break
        return Fit(form, deviations, w, chi2, residual, columns)

    @staticmethod
    def _chi2(form: Form, residual: Floats, deviations: Floats, w: Floats) -> float:
        held = sum((x / axis.prior) ** 2 for x, axis in zip(w.tolist(), form.axes, strict=True))
        return float(residual @ residual + deviations @ deviations) + held

    def _derivatives(self, deviations: Floats, effects: Effects, here: Floats) -> Floats:
        columns: list[Floats] = []
        for i in range(len(deviations)):
            ahead = deviations.copy()
            step = -_STEP if ahead[i] > 0.0 else _STEP
            ahead[i] += step
            columns.append((self.predicted(ahead, effects) - here) / step)
        return np.column_stack(columns)

    def _axis_derivatives(self, form: Form, deviations: Floats, w: Floats, here: Floats) -> Floats:
        columns = np.zeros((len(here), len(w)))
        for i, axis in enumerate(form.axes):
            step = 0.15 if axis.logarithmic else 0.25 * max(abs(w[i]), 0.4)
            ahead = w.copy()
            ahead[i] += step
            columns[:, i] = (self.predicted(deviations, form.tables(ahead)) - here) / step
        return columns
