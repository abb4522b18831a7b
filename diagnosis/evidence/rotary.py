"""Conversion of a rotary rig to a rig that slides at a radius: N m, rad and kg m2 become N, m and kg there.

At a radius of 1 m every number keeps its digits.
"""

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
    numbers = {name: _at(name, value, radius_m) for name, value in rig.values().items() if value is not None}
    return rig.model_copy(update=numbers | {"drive": "spring", "radius_m": radius_m})


def run_as_sliding(rig: RigTable, columns: Columns, table: RunTable) -> tuple[Columns, RunTable]:
    """The columns [samples] and the run of a rotary rig at its radius; of every other rig unchanged."""
    if rig.drive != "torsion":
        return columns, table
    radius_m = rig.radius_m or 1.0
    moved = {name: values * radius_m ** STANDARD[name].radius_power for name, values in columns.items()}
    velocity = table.drive_velocity_mps
    return moved, table if velocity is None else table.model_copy(update={"drive_velocity_mps": velocity * radius_m})


def _at(name: str, value: float, radius_m: float) -> float:
    return value * radius_m ** _POWERS[name]


def told(rig: RigTable) -> list[Finding]:
    """A finding with the units and the radius of a rotary rig's numbers; empty for every other rig."""
    if rig.drive != "torsion":
        return []
    text = f"rotary: numbers are in N, m and kg at a radius of {rig.radius_m or 1.0:g} m" + (
        ", where they equal those in N m, rad and kg m2" if (rig.radius_m or 1.0) == 1.0 else ""
    )
    return [Finding("rotary", f"{MANIFEST}: rig.drive", text)]
