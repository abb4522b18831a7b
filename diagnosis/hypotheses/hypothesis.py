"""A model to be fitted: effects in given formulas, and their free parameters as coordinates with scales that fit a rig."""

import math
from typing import Final, NamedTuple

import numpy as np

from bridge.arrays import Floats
from diagnosis.evidence.manifest import RigTable
from diagnosis.features.grid import BLOCK_S
from diagnosis.gap.prepare import Prepared
from diagnosis.model.per_run import is_phase
from diagnosis.model.rig import Effects
from plant.effects.library import EFFECTS

# The explanation that the described mass is wrong. The library has no such effect: its probability counts as no effect.
MASS: Final = "mass"
# Explanation -> number of the rig table that it changes. Both are one direction of the fit and share a derivative: with a
# derivative for each, the number stays at its bound, the effect stays too small, and another effect is named.
LEVELS = {
    "coulomb-level": "coulomb_force_N",
    "static-level": "static_force_N",
    "stribeck-velocity": "stribeck_velocity_mps",
    "drive-stiffness": "drive_stiffness_N_per_m",
    MASS: "mass_kg",
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
            if name == MASS:
                continue
            for parameter in EFFECTS[name].forms[form].parameters:
                tables[name].setdefault(parameter.name, parameter.default)
        return tables


NOTHING = Hypothesis({}, ())


class Scale(NamedTuple):
    """How a parameter becomes a coordinate; a `logarithmic` parameter stays positive."""

    scale: float
    logarithmic: bool
    prior: float = 1.0


class Sizes(NamedTuple):
    """Typical sizes of a rig and its runs."""

    static_N: float
    stiffness_N_per_m: float  # stiffness of the drive's spring; with a force drive, of the contact
    reach_m: float  # extension of that spring at the static friction
    critical_Ns_per_m: float  # critical damping of the mass on that spring
    slip_s: float  # duration of a slip
    slip_mps: float  # speed of a slip
    length_s: float  # duration of the longest run
    highest_Hz: float  # highest frequency of the vibration; 0 without a vibration


def longest_run_s(runs: list[Prepared]) -> float:
    """Duration of the longest run."""
    return max(len(run.commands.drive) for run in runs) * BLOCK_S


def sizes(rig: RigTable, runs: list[Prepared], highest_Hz: float) -> Sizes:
    """The sizes of a described rig in these runs."""
    stiffness = rig.drive_stiffness_N_per_m or rig.contact_stiffness_N_per_m
    static_N = rig.static_force_N
    critical = 2.0 * math.sqrt(stiffness * rig.mass_kg)
    slip_s = math.pi * math.sqrt(rig.mass_kg / stiffness)
    slip_mps = 0.3 * static_N / math.sqrt(stiffness * rig.mass_kg)
    motions = [run.commands.motion for run in runs if run.commands.motion is not None]
    if motions:  # no spring: speeds and times come from the motion
        slip_mps = max(float(np.abs(motion.velocity_mps).max()) for motion in motions)
        critical = static_N / slip_mps
        slip_s = 0.05
    return Sizes(static_N, stiffness, static_N / stiffness, critical, slip_s, slip_mps, longest_run_s(runs), highest_Hz)
