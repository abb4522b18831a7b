"""Numbers of a rig that do not go with what is seen in a record: a unit is the usual reason."""

import math
from collections.abc import Mapping

from bridge.log.finding import Finding
from diagnosis.look.look import Look

_FAR = 3.0  # factor between a number and what is seen, from which a unit is asked about
_SEEN = {
    "mass_kg": "mass_kg",
    "drive_stiffness_N_per_m": "stiffness_N_per_m",
    "static_force_N": "static_force_N",
    "coulomb_force_N": "kinetic_force_N",
}
# factor that a wrong unit brings, and what was probably meant
_UNITS: Mapping[str, tuple[tuple[float, str], ...]] = {
    "mass_kg": ((1e3, "g"), (1e-3, "t"), (9.81, "N, as a weight")),
    "drive_stiffness_N_per_m": ((1e-3, "N/mm"), (1e-6, "N/um"), (1e3, "mN/m")),
    "static_force_N": ((1e-3, "kN"), (1e3, "mN"), (0.102, "kgf")),
    "coulomb_force_N": ((1e-3, "kN"), (1e3, "mN"), (0.102, "kgf")),
}


def hints(seen: Look, rig: Mapping[str, float]) -> list[Finding]:
    """A finding for each number of a rig that is far from what the record shows."""
    found: list[Finding] = []
    for name, value in rig.items():
        number = seen.numbers.get(_SEEN.get(name, ""))
        if number is None or not value > 0.0 or not number.value > 0.0:
            continue
        ratio = value / number.value
        if 1.0 / _FAR < ratio < _FAR:
            continue
        unit = min(_UNITS[name], key=lambda one: abs(math.log(ratio / one[0])))
        meant = f"; is it in {unit[1]}?" if abs(math.log(ratio / unit[0])) < math.log(_FAR) else ""
        text = f"{value:g} is {ratio:.3g} times the {number.value:.4g} {number.unit} that the record shows{meant}"
        found.append(Finding("units", name, text))
    return found
