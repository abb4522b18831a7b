"""A record as evidence: rig numbers estimated from the record, with tolerances from their scatter; numbers that contradict it."""

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from bridge.config import validate
from bridge.faults import Fault
from bridge.log.finding import Finding
from cockpit.look.source import MeasuredRecord
from diagnosis.evidence.assumed import with_assumed
from diagnosis.evidence.import_table import write_run
from diagnosis.evidence.manifest import RigTable, RunTable, rig_lines
from diagnosis.evidence.manifest_keys import Columns
from diagnosis.look.look import LookResult

_LEAST_TOLERANCE = 0.01  # least relative tolerance of a number: sensors are calibrated to 1 %
_FRICTION_TOLERANCE = 0.05  # least relative tolerance of F_s and F_k: friction differs with the load of each slip
_OTHER_TOLERANCE = 0.3  # relative tolerance of described numbers that no record shows well: contact and damping
_OF_90 = 1.645  # half width of a 90 % interval in standard deviations
_FAR = 3.0  # factor between the given and the estimated number above which the unit is questioned
_SEEN = {
    "mass_kg": "mass_kg",
    "drive_stiffness_N_per_m": "stiffness_N_per_m",
    "static_force_N": "static_force_N",
    "coulomb_force_N": "kinetic_force_N",
}  # estimate from the record to which a rig number is compared
# by rig number: factors by which a value in a wrong unit is off, each with that unit
_UNITS: Mapping[str, tuple[tuple[float, str], ...]] = {
    "mass_kg": ((1e3, "g"), (1e-3, "t"), (9.81, "N, as a weight")),
    "drive_stiffness_N_per_m": ((1e-3, "N/mm"), (1e-6, "N/um"), (1e3, "mN/m")),
    "static_force_N": ((1e-3, "kN"), (1e3, "mN"), (0.102, "kgf")),
    "coulomb_force_N": ((1e-3, "kN"), (1e3, "mN"), (0.102, "kgf")),
}


def rig_of(seen: LookResult, file: str, described: Mapping[str, float]) -> tuple[RigTable, list[str]]:
    """A rig with the numbers that a log describes or that the record shows, and the names of its assumed numbers.

    Raises Fault CONFIG, with an option to copy, for a number that can be neither estimated nor assumed.
    """
    numbers = seen.numbers
    if seen.known.unit:
        line = f"{file}: holds no force but a number in {seen.known.unit}: a rig needs a force"
        raise Fault("CONFIG", f"{line}; `stickslip look` reads it, and a map with scale = ... makes a force of it")
    if seen.known.coefficient:
        raise Fault(
            "CONFIG", f"{file}: has a friction coefficient but no load, so the force is unknown; add --load 94.5N"
        )
    shown = numbers.keys() | {_SEEN[name] for name in described.keys() & _SEEN.keys()}
    if not {"kinetic_force_N", "static_force_N"} <= shown:
        raise Fault(
            "CONFIG", f"{file}: shows no slip, so no rig number can be estimated; import it with a map that has [rig]"
        )
    if "stiffness_N_per_m" not in shown:
        raise Fault("CONFIG", f"{file}: the speed of the drive is unknown; add --speed 0.5mm/s")
    mass = numbers.get("mass_kg")
    has_mass = seen.known.mass_kg is not None or "mass_kg" in described
    if not has_mass and (mass is None or not np.isfinite(mass.low) or mass.low <= 0.0):
        raise Fault("CONFIG", f"{file}: its slips are too short to estimate the mass of the slide; add --mass 1.5kg")
    table = {"drive": "torsion" if seen.known.torsion else "spring", **described}
    least_of = {"coulomb_force_N": _FRICTION_TOLERANCE, "static_force_N": _FRICTION_TOLERANCE}
    tolerance = {
        name: least_of.get(name, _LEAST_TOLERANCE if name in _SEEN else _OTHER_TOLERANCE) for name in described
    }
    for name in (name for name in _SEEN if name not in described):
        number, least = numbers.get(_SEEN[name]), least_of.get(name, _LEAST_TOLERANCE)
        if number is None:
            continue
        half = (number.high - number.low) / (2.0 * _OF_90 * number.value)
        tolerance[name] = min(max(half if np.isfinite(half) else least, least), 1.0)
        table[name] = float(number.value)
    if seen.known.mass_kg is not None:
        table["mass_kg"] = float(seen.known.mass_kg)
        tolerance["mass_kg"] = _LEAST_TOLERANCE
    filled, assumed = with_assumed({**table, "tolerance": tolerance})
    return validate(RigTable, filled, file), assumed


def full_map(record: MeasuredRecord, seen: LookResult) -> str:
    """Map of a record with its rig, for `log import`. Raises Fault as `rig_of`."""
    rig, assumed = rig_of(seen, record.path.name, record.rig)
    return "\n".join([record.map_text.rstrip(), "", *rig_lines(rig, assumed)]) + "\n"


def columns_of(record: MeasuredRecord) -> Columns:
    """The standard columns of a record, [samples] each, SI units."""
    columns = {"t_s": record.t_s, "drive_force_N": record.force_N, **record.others}
    return columns if record.position_m is None else columns | {"drive_position_m": record.position_m}


def write_evidence(record: MeasuredRecord, seen: LookResult, folder: Path) -> tuple[RigTable, list[str]]:
    """Make `folder` an evidence folder of this record; returns its rig and the assumed numbers. Raises Fault, OSError."""
    rig, assumed = rig_of(seen, record.path.name, record.rig)
    speed = seen.known.speed_mps if record.position_m is None else None
    run = RunTable(file=record.path.stem + ".parquet", drive_velocity_mps=speed)
    folder.mkdir(parents=True, exist_ok=True)
    write_run(folder, columns_of(record), rig, [run], assumed)
    return rig, assumed


def hints(seen: LookResult, rig: Mapping[str, float]) -> list[Finding]:
    """A finding for each rig number that differs by a factor of _FAR from the record."""
    findings: list[Finding] = []
    for name, value in rig.items():
        number = seen.numbers.get(_SEEN.get(name, ""))
        if number is None or not value > 0.0 or not number.value > 0.0:
            continue
        ratio = value / number.value
        if 1.0 / _FAR < ratio < _FAR:
            continue
        unit = min(_UNITS[name], key=lambda wrong: abs(math.log(ratio / wrong[0])))
        asked = [f"is it in {unit[1]}?"] if abs(math.log(ratio / unit[0])) < math.log(_FAR) else []
        if seen.known.speed_mps is not None and name in ("mass_kg", "drive_stiffness_N_per_m"):
            asked.append(f"is --speed {ratio:.2g} times the true speed?")  # both numbers are proportional to 1 / speed
        meant = f"; {' Or '.join(asked)}" if asked else ""
        text = f"{value:g} is {ratio:.3g} times the {number.value:.4g} {number.unit} that the record shows{meant}"
        findings.append(Finding("units", name, text))
    return findings
