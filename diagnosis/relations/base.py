"""The base relation: a base that rests shows no acceleration when the slide breaks away and comes to rest."""

import numpy as np

from diagnosis.evidence.manifest import RigTable
from diagnosis.features.feature import scales_of
from diagnosis.features.grid import BLOCK_S
from diagnosis.gap.prepare import Prepared
from diagnosis.relations.relation import Missing, Relation, pieces_without_vibration, term
from diagnosis.relations.shapes import bend, free, mode, rate, slip_phase

NEEDED = ("base_accel_mps2", "drive_force_N", "mass_accel_mps2")
_HIGHEST_HZ = 320.0  # of a mode of the base
_RESOLUTION = 1e-5  # least noise of a row, as a share of the acceleration that the static friction gives the slide
_MODES_HZ = np.geomspace(45.0, 300.0, 28)  # that a mode may have: steps of 7 %
_CROSS = 0.01  # share of the slide's acceleration that an ordinary accelerometer on the base shows
_COMPLIANCE = 0.02  # of a large effect, as a share of the drive's


def base_relation(rig: RigTable, runs: list[Prepared]) -> Relation | Missing:
    """The relation in m/s2, away from vibration; `Missing` where a run lacks a channel or always vibrates."""
    stiffness = rig.drive_stiffness_N_per_m
    if stiffness is None:
        return Missing("base", 'drive = "force": nothing slips')
    pieces = pieces_without_vibration("base", NEEDED, runs)
    if isinstance(pieces, Missing):
        return pieces
    accel = [run.signals["mass_accel_mps2"] for run in runs]
    friction = [run.signals["drive_force_N"] - rig.mass_kg * run.signals["mass_accel_mps2"] for run in runs]
    since = [slip_phase(rate(run.signals["drive_force_N"]), scales_of(rig).slip_s) for run in runs]
    modes = tuple(
        term(
            "base-compliance", f"{each_Hz:.3g} Hz", [bend(mode(force, each_Hz, 0.02)) for force in friction],
            _COMPLIANCE / stiffness, 1, "compliance_m_per_N",
        )
        for each_Hz in _MODES_HZ.tolist()
    )  # fmt: skip
    return Relation(
        name="base", unit="m/s2", row_s=BLOCK_S, highest_Hz=_HIGHEST_HZ,
        left=tuple(run.signals["base_accel_mps2"] for run in runs),
        pieces=pieces,
        nuisances=(term("cross sensitivity", "", accel, _CROSS),),
        effects=modes,
        patterns=(free("the time since a slip", since, 14),),
        resolution=_RESOLUTION * rig.static_force_N / rig.mass_kg,
    )  # fmt: skip
