"""Scales of the parameters: how large a step is worth trying, from typical sizes of a rig."""

import math
from typing import NamedTuple

from diagnosis.evidence.manifest import RigTable
from diagnosis.features.grid import BLOCK_S
from diagnosis.gap.prepare import Prepared


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
    if rig.drive == "force":  # no spring: speeds and times come from the motion
        slip_mps = max(20.0 * rig.stribeck_velocity_mps, 0.05)
        critical = static_N / slip_mps
        slip_s = 0.05
    return Sizes(static_N, stiffness, static_N / stiffness, critical, slip_s, slip_mps, longest_run_s(runs), highest_Hz)
