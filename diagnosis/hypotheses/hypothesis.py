"""A model to be fitted: effects in given formulas, and their free parameters as coordinates."""

import math
from typing import NamedTuple

from bridge.arrays import Floats
from diagnosis.model.per_run import is_phase
from diagnosis.model.rig import Effects
from plant.effects.library import EFFECTS

# Effects that change a number of the rig table alone: number and effect are one direction of the fit. With a separate derivative
# for each, the number stays at its bound and the effect at 3 of 10 %: chi2 196 in place of 133, and another effect is named.
LEVELS = {
    "coulomb-level": "coulomb_force_N",
    "static-level": "static_force_N",
    "stribeck-velocity": "stribeck_velocity_mps",
    "drive-stiffness": "drive_stiffness_N_per_m",
}


class Coordinate(NamedTuple):
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
        if is_phase(self.name):
            return math.remainder(raw, 2.0 * math.pi)
        return min(max(raw, self.low), self.high)


class Hypothesis(NamedTuple):
    """Effects in given formulas with their free parameters; the others are held."""

    forms: dict[str, str]  # effect -> form
    coordinates: tuple[Coordinate, ...]

    @property
    def effects(self) -> tuple[str, ...]:
        """Names."""
        return tuple(self.forms)

    def tables(self, w: Floats) -> Effects:
        """As a rig file would have them."""
        tables: Effects = {name: {"form": form} for name, form in self.forms.items()}
        for coordinate, value in zip(self.coordinates, w.tolist(), strict=True):
            tables[coordinate.effect][coordinate.name] = coordinate.value(value)
        for name, form in self.forms.items():
            for parameter in EFFECTS[name].forms[form].parameters:
                tables[name].setdefault(parameter.name, parameter.default)
        return tables


NOTHING = Hypothesis({}, ())
