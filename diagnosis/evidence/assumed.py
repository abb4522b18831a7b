"""Assumed values of rig numbers that few owners know, where a manifest or a channel map leaves them out."""

import math
from typing import Any

from pydantic import TypeAdapter, ValidationError

from diagnosis.evidence.manifest_keys import Positive

_POSITIVE: TypeAdapter[float] = TypeAdapter(Positive)
# Presliding length that is assumed when no contact stiffness is given: the paper's steel pair reaches its static force after
# 0.22 um, and other metals after a fraction of a micrometre. Too small: a stiff contact, small steps; too large: soft sticks.
_PRESLIDING_M = 0.22e-6
_TOLERANCE = 0.3  # relative tolerance of the contact numbers: 3.3 standard deviations reach 0.11 to 2.2 um
# Stribeck velocities of dry and boundary-lubricated pairs lie between 0.1 and 10 mm/s.
_STRIBECK_MPS = 1e-3
# On a rotary rig whose radius is not given: presliding over the angle that the spring turns up to the static torque, and the
# Stribeck velocity over static torque / sqrt(stiffness x inertia), both as on the paper's rig.
_OF_REACH, _OF_SLIP = 1.5e-4, 0.0076
_WIDE = 1.0  # tolerance of an unknown number: it may be a third or three times as large
_SLIP_S = 0.1  # assumed duration of a slip, for a mass that the runs do not show
WIDE = ("mass_kg", "stribeck_velocity_mps")  # numbers with so wide a tolerance that they decide nothing


def with_assumed(given: dict[str, Any], mass_kg: float | None = None) -> tuple[dict[str, Any], list[str]]:
    """The table `[rig]` with every number that may be left out, with tolerances; and the names of the added numbers.

    `mass_kg`: the mass estimated from the runs, for a table without a mass.
    """
    table = dict(given)
    turns = table.get("drive") == "torsion"
    assumed: dict[str, Any] = {"viscous_damping_Ns_per_m": 0.0}
    if turns or table.get("drive") == "spring":
        assumed["drive_damping_Ns_per_m"] = 0.0
    static_N = _positive(table.get("static_force_N"))
    if "mass_kg" not in table:
        # a mass that slips in a tenth of a second; with a force drive, a mass that its friction decelerates by 10 m/s²
        stiffness = table.get("drive_stiffness_N_per_m")
        slips_kg = static_N / 10.0 if stiffness is None else _positive(stiffness) * (_SLIP_S / math.pi) ** 2
        assumed["mass_kg"] = mass_kg or slips_kg
    mass = _positive(table.get("mass_kg", assumed.get("mass_kg")))
    presliding, stribeck = _PRESLIDING_M, _STRIBECK_MPS
    if turns and "radius_m" in table:  # the way in rad is the way in m over the radius
        radius_m = _positive(table["radius_m"])
        presliding, stribeck = presliding / radius_m, stribeck / radius_m
    elif turns:
        drive = _positive(table.get("drive_stiffness_N_per_m"))
        presliding, stribeck = _OF_REACH * static_N / drive, _OF_SLIP * static_N / math.sqrt(drive * mass)
    assumed["stribeck_velocity_mps"] = stribeck
    stiffness = _positive(table.get("contact_stiffness_N_per_m", static_N / presliding))
    assumed["contact_stiffness_N_per_m"] = stiffness
    # critical damping of the presliding motion, as for the paper's pairs
    assumed["contact_damping_Ns_per_m"] = 2.0 * (stiffness * mass) ** 0.5
    filled = [name for name in assumed if name not in table]
    if isinstance(table.get("tolerance", {}), dict):  # any other type is refused by `validate`
        unsure = {name: _TOLERANCE for name in filled if name.startswith("contact")}
        unsure |= {name: _WIDE for name in filled if name in WIDE}
        if unsure or "tolerance" in table:
            table["tolerance"] = unsure | table.get("tolerance", {})
    return assumed | table, filled


def _positive(value: Any) -> float:
    """The number, or 1 where `validate` will refuse it: a wrong number must not make others seem to be missing."""
    try:
        return _POSITIVE.validate_python(value, strict=True)
    except ValidationError:
        return 1.0
