"""A model to be fitted: effects in given formulas, and their free parameters as coordinates."""

import math
from typing import NamedTuple

from bridge.arrays import Floats
from diagnosis.model.per_run import is_phase
from diagnosis.model.rig import Effects
from plant.effects.library import EFFECTS

# Effect -> number of the rig table that it changes. Both are one direction of the fit and share a derivative: with a derivative
# for each, the number stays at its bound, the effect stays too small, and another effect is named.
LEVELS = {
    "coulomb-level": "coulomb_force_N",
    "static-level": "static_force_N",
    "stribeck-velocity": "stribeck_velocity_mps",
    "drive-stiffness": "drive_stiffness_N_per_m",
}


class Coordinate(NamedTuple):
    """A parameter of an effect as a coordinate w: value = scale * w, or scale * exp(w) where it must stay positive."""

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
    """Effects in given forms with their free parameters; the other parameters keep their default."""

    forms: dict[str, str]  # effect -> form
    coordinates: tuple[Coordinate, ...]

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects."""
        return tuple(self.forms)

    def tables(self, w: Floats) -> Effects:
        """The effects at the coordinates `w`, as tables of a rig file."""
        tables: Effects = {name: {"form": form} for name, form in self.forms.items()}
        for coordinate, value in zip(self.coordinates, w.tolist(), strict=True):
            tables[coordinate.effect][coordinate.name] = coordinate.value(value)
        for name, form in self.forms.items():
            for parameter in EFFECTS[name].forms[form].parameters:
                tables[name].setdefault(parameter.name, parameter.default)
        return tables


NOTHING = Hypothesis({}, ())
