"""Machine axes on which the controller is tried."""

import math
from typing import Any

STATIC_N, COULOMB_N, MASS_KG = 150.0, 120.0, 50.0
STRIBECK_MPS = 5e-4


def machine_axis(stiffness_N_per_m: float, velocity_mps: float = 5e-4, force_noise_N: float = 0.3) -> dict[str, Any]:
    """A rig with a slide of 50 kg that breaks away at 150 N and slides at 120 N, for both directions."""
    contact_N_per_m = STATIC_N / 0.22e-6
    return {
        "contact": {
            "stiffness_N_per_m": contact_N_per_m,
            "damping_Ns_per_m": 2.0 * math.sqrt(contact_N_per_m * MASS_KG),
            "coulomb_force_N": COULOMB_N,
            "static_force_N": STATIC_N,
            "stribeck_velocity_mps": STRIBECK_MPS,
        },
        "slide": {"mass_kg": MASS_KG},
        "drive": {
            "stiffness_N_per_m": stiffness_N_per_m,
            "damping_Ns_per_m": 0.04 * math.sqrt(stiffness_N_per_m * MASS_KG),
            "profile": [(0.0, velocity_mps)],
        },
        "sensors": {
            "force_range_N": 500.0,
            "force_lowest_N": -500.0,
            "force_noise_N": force_noise_N,
            "force_resolution_N": 500.0 / 2**16,
            "position_lowest_m": -0.05,
        },
        "piezo": {"amplitude_max_m": 1e-6, "amplitude_slew_m_per_s": 1e-5},
    }


def told(stiffness_N_per_m: float, **more: Any) -> dict[str, Any]:
    """A controller for such an axis, configured with this stiffness of the drive."""
    limits = {"amplitude_max_m": 1e-6, "slew_m_per_s": 1e-5}
    return {
        "contact_resonance_Hz": 587.0,
        "drive_stiffness_N_per_m": stiffness_N_per_m,
        "limits": limits,
        **more,
    }
