"""The base relation: a base that rests shows no acceleration when the slide breaks away and stops."""

from diagnosis.evidence.manifest import RigTable
from diagnosis.features.feature import scales_of
from diagnosis.features.grid import BLOCK_S
from diagnosis.gap.prepare import Prepared
from diagnosis.model.sensor_chain import ACCEL_GAIN
from diagnosis.relations.relation import LARGE, RESOLUTION, Missing, Relation, pieces_without_vibration, term
from diagnosis.relations.shapes import MODES_HZ, bend, free, mode, rate, slip_phase

NEEDED = ("base_accel_mps2", "drive_force_N", "mass_accel_mps2")


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
            LARGE / stiffness, 1, "compliance_m_per_N",
        )
        for each_Hz in MODES_HZ.tolist()
    )  # fmt: skip
    return Relation(
        name="base", unit="m/s2", row_s=BLOCK_S, highest_Hz=float(MODES_HZ[-1]),
        left=tuple(run.signals["base_accel_mps2"] for run in runs),
        pieces=pieces,
        nuisances=(term("cross sensitivity", "", accel, ACCEL_GAIN),),
        effects=modes,
        patterns=(free("the time since a slip", since, 14),),
        resolution=RESOLUTION * rig.static_force_N / rig.mass_kg,
    )  # fmt: skip
