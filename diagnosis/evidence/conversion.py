"""Conversion of a rotary rig to a rig that slides at a radius: N m, rad and kg m2 become N, m and kg there.

At a radius of 1 m every number keeps its digits.
"""

import numpy as np
from scipy.integrate import cumulative_trapezoid

from bridge.faults import Fault
from bridge.log.finding import Finding
from diagnosis.evidence.manifest import MANIFEST, RigTable, RunTable
from diagnosis.evidence.manifest_keys import STANDARD, Columns

# power of the radius by which a number of [rig] is multiplied on a rotary rig
_POWERS = {
    "mass_kg": -2,
    "drive_stiffness_N_per_m": -2,
    "drive_damping_Ns_per_m": -2,
    "contact_stiffness_N_per_m": -2,
    "contact_damping_Ns_per_m": -2,
    "viscous_damping_Ns_per_m": -2,
    "coulomb_force_N": -1,
    "static_force_N": -1,
    "stribeck_velocity_mps": 1,
    "force_per_current_N_per_A": -1,
}


def as_sliding(rig: RigTable) -> RigTable:
    """The sliding rig that a rotary rig is at its `radius_m`; every other rig unchanged."""
    if rig.drive != "torsion":
        return rig
    radius_m = rig.radius_m or 1.0
    numbers = {name: value * radius_m ** _POWERS[name] for name, value in rig.values().items() if value is not None}
    return rig.model_copy(update=numbers | {"drive": "spring", "radius_m": radius_m})


def run_as_sliding(rig: RigTable, columns: Columns, table: RunTable) -> tuple[Columns, RunTable]:
    """The columns [samples] and the run of a rotary rig at its radius; of every other rig unchanged."""
    if rig.drive != "torsion":
        return columns, table
    radius_m = rig.radius_m or 1.0
    moved = {name: values * radius_m ** STANDARD[name].radius_power for name, values in columns.items()}
    velocity = table.drive_velocity_mps
    return moved, table if velocity is None else table.model_copy(update={"drive_velocity_mps": velocity * radius_m})


def told(rig: RigTable) -> list[Finding]:
    """A finding with the units and the radius of a rotary rig's numbers; empty for every other rig."""
    if rig.drive != "torsion":
        return []
    text = f"rotary: numbers are in N, m and kg at a radius of {rig.radius_m or 1.0:g} m" + (
        ", where they equal those in N m, rad and kg m2" if (rig.radius_m or 1.0) == 1.0 else ""
    )
    return [Finding("rotary", f"{MANIFEST}: rig.drive", text)]


def with_beside(columns: Columns, rig: RigTable, table: RunTable) -> tuple[Columns, list[Finding]]:
    """The columns [samples] completed from the manifest and the further columns, in the units of the manifest; and findings.

    Raises Fault BAD_EVIDENCE for a motor current without its constant, where no other column gives the force.
    """
    completed = dict(columns)
    findings: list[Finding] = []

    def note(name: str, text: str) -> None:
        findings.append(Finding("besides", f"{table.name}: {name}", text))

    if "motor_current_A" in completed and rig.drive == "force" and "drive_force_N" not in completed:
        if rig.force_per_current_N_per_A is None:
            line = f"{MANIFEST}: rig.force_per_current_N_per_A: missing; {table.name} has motor_current_A and no drive_force_N"
            raise Fault("BAD_EVIDENCE", f"{line}; add it")
        completed["drive_force_N"] = rig.force_per_current_N_per_A * completed["motor_current_A"]
        note("drive_force_N", f"is motor_current_A times {rig.force_per_current_N_per_A:g} N/A")
    if table.tare_N and "drive_force_N" in completed:
        completed["drive_force_N"] = completed["drive_force_N"] - table.tare_N
    if "other_force_N" in completed:
        if rig.drive == "force" and "drive_force_N" in completed:
            completed["drive_force_N"] = completed["drive_force_N"] + completed["other_force_N"]
            note("other_force_N", "is added to drive_force_N: both act on the mass")
        else:
            note("other_force_N", "counts in the measured friction, not in the fits")
    for velocity, position in (("mass_velocity_mps", "mass_position_m"), ("drive_velocity_mps", "drive_position_m")):
        # an integral is not accurate enough for the position of a slide on a spring
        usable = rig.drive == "force" if position == "mass_position_m" else rig.drive != "force"
        if usable and velocity in completed and position not in completed:
            completed[position] = cumulative_trapezoid(
                np.nan_to_num(completed[velocity]), completed["t_s"], initial=0.0
            )
            note(position, f"missing: {velocity} is integrated, so positions have an unknown constant")
    if table.normal_load_N is not None and "normal_load_N" not in completed:
        completed["normal_load_N"] = np.full(len(completed["t_s"]), table.normal_load_N)
    return completed, findings
