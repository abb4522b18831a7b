"""Rig numbers that an owner can hardly know: what is assumed where a manifest or a channel map leaves them out."""

from typing import Any

from pydantic import TypeAdapter, ValidationError

from diagnosis.evidence.manifest_keys import Positive

_POSITIVE: TypeAdapter[float] = TypeAdapter(Positive)
# Presliding length that is assumed when no contact stiffness is given: the paper's steel pair reaches its static force after
# 0.22 um, and other metals after a fraction of a micrometre. Too small: a stiff contact, small steps; too large: soft sticks.
_PRESLIDING_M = 0.22e-6
_TOLERANCE = 0.3  # relative, of the numbers that follow from it: 3.3 standard deviations reach 0.11 to 2.2 um


def with_assumed(given: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """The table `[rig]` with every number that may be left out, with tolerances; and the names of what was added."""
    table = dict(given)
    assumed: dict[str, Any] = {"viscous_damping_Ns_per_m": 0.0}
    if table.get("drive") in ("spring", "torsion"):
        assumed["drive_damping_Ns_per_m"] = 0.0
    mass_kg, static_N = _positive(table.get("mass_kg")), _positive(table.get("static_force_N"))
    # on a rig that turns the way in rad is shorter by the radius
    presliding = _PRESLIDING_M / (_positive(table.get("radius_m", 1.0)) if table.get("drive") == "torsion" else 1.0)
    stiffness = _positive(table.get("contact_stiffness_N_per_m", static_N / presliding))
    assumed["contact_stiffness_N_per_m"] = stiffness
    # critical damping of the presliding motion, as for the paper's pairs
    assumed["contact_damping_Ns_per_m"] = 2.0 * (stiffness * mass_kg) ** 0.5
    filled = [name for name in assumed if name not in table]
    if isinstance(table.get("tolerance", {}), dict):  # any other type is refused by `validate`
        unsure = {name: _TOLERANCE for name in filled if name.startswith("contact")}
        if unsure or "tolerance" in table:
            table["tolerance"] = unsure | table.get("tolerance", {})
    return assumed | table, filled


def _positive(value: Any) -> float:
    """The number, or 1 in place of what `validate` refuses: one wrong number must not make others seem to be missing."""
    try:
        return _POSITIVE.validate_python(value, strict=True)
    except ValidationError:
        return 1.0
