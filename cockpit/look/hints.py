"""Rig numbers that contradict the record, usually because of a wrong unit."""

import math
from collections.abc import Mapping

from bridge.log.finding import Finding
from diagnosis.look.look import LookResult

_FAR = 3.0  # factor between the given and the estimated number above which the unit is questioned
_SEEN = {
    "mass_kg": "mass_kg",
    "drive_stiffness_N_per_m": "stiffness_N_per_m",
    "static_force_N": "static_force_N",
    "coulomb_force_N": "kinetic_force_N",
}
# factor of a wrong unit, and the unit probably meant
_UNITS: Mapping[str, tuple[tuple[float, str], ...]] = {
    "mass_kg": ((1e3, "g"), (1e-3, "t"), (9.81, "N, as a weight")),
    "drive_stiffness_N_per_m": ((1e-3, "N/mm"), (1e-6, "N/um"), (1e3, "mN/m")),
    "static_force_N": ((1e-3, "kN"), (1e3, "mN"), (0.102, "kgf")),
    "coulomb_force_N": ((1e-3, "kN"), (1e3, "mN"), (0.102, "kgf")),
}


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
        meant = f"; is it in {unit[1]}?" if abs(math.log(ratio / unit[0])) < math.log(_FAR) else ""
        text = f"{value:g} is {ratio:.3g} times the {number.value:.4g} {number.unit} that the record shows{meant}"
        findings.append(Finding("units", name, text))
    return findings
