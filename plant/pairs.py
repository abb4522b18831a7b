"""Friction pairs by name: Table 2 of the paper, and PTFE with assumed values.

The paper prints k_t in N/m in Table 2 and in N/um in Table 1; N/um is right: h_t = 2 sqrt(k_t m), their zeta = 1, gives
2.157e4 N s/m from 77.52 N/um and 1.5 kg, the printed 2.15e4.

PTFE: the paper gives k_t and reports only that no stick-slip occurred. Assumed here: a friction coefficient of 0.08 and no
drop from static to kinetic friction, so F_s = F_c. Published ranges for PTFE on steel are 0.05-0.10 static and 0.04-0.08
kinetic, "remarkably close" to each other (kintek-solution.com/faqs, typical friction coefficient values for PTFE). A pair
without stick-slip must have no drop. h_t follows the paper's zeta = 1; F = mu p_n A, A = 1192 mm2.
"""

import math
from typing import Final

_AREA_MM2: Final = 1192.0
_PAPER_MASS_KG: Final = 1.5
_PTFE_FRICTION_COEFFICIENT: Final = 0.08


def _ptfe(stiffness_N_per_um: float, pressure_N_per_mm2: float) -> dict[str, float]:
    stiffness_N_per_m = stiffness_N_per_um * 1e6
    force_N = _PTFE_FRICTION_COEFFICIENT * pressure_N_per_mm2 * _AREA_MM2
    return {
        "stiffness_N_per_m": stiffness_N_per_m,
        "damping_Ns_per_m": 2.0 * math.sqrt(stiffness_N_per_m * _PAPER_MASS_KG),
        "coulomb_force_N": force_N,
        "static_force_N": force_N,
    }


def _steel(stiffness_N_per_um: float, damping_Ns_per_m: float, coulomb_N: float, static_N: float) -> dict[str, float]:
    return {
        "stiffness_N_per_m": stiffness_N_per_um * 1e6,
        "damping_Ns_per_m": damping_Ns_per_m,
        "coulomb_force_N": coulomb_N,
        "static_force_N": static_N,
    }


PAIRS: Final[dict[str, dict[str, float]]] = {
    "C45-C45 @ 0.063": _steel(77.52, 2.15e4, 14.49, 17.38),
    "C45-C45 @ 0.104": _steel(95.66, 2.39e4, 23.94, 29.92),
    "C45-GGG40 @ 0.063": _steel(71.15, 2.07e4, 13.23, 15.88),
    "C45-GGG40 @ 0.104": _steel(107.74, 2.54e4, 21.86, 26.67),
    "C45-PTFE @ 0.063": _ptfe(4.89, 0.063),
    "C45-PTFE @ 0.104": _ptfe(6.42, 0.104),
}
