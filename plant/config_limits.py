"""Rejection of rig files that pass every rule on single numbers but make the model unphysical."""

import math

import numpy as np

from plant.config import RigConfig
from plant.records import build

# Largest h_t dt / m. Larger: the solver step accelerates a vibrated slide falsely (4.3: threefold velocity; 2.15: mean force off
# by 0.6 %). Smaller: sound rigs are refused. Counted: docs/method/rig.md.
_MOST_DAMPING = 2.0
# v / v_s at which the Stribeck curve is checked; beyond the last one the curve only approaches the Coulomb force
_VELOCITY_RATIOS = np.linspace(0.0, 10.0, 2001)
_ANGLES_RAD = np.linspace(0.0, 2.0 * math.pi, 2001)


def refuse_what_no_rig_does(rig: RigConfig) -> None:
    """Raise ValueError for a damper too strong for the step, friction of 0 or less, and a ripple that stops the drive."""
    _contact_damping(rig)
    _stribeck_curve(rig)
    _ripple(rig)


def refuse_a_spring_of_another_rig(rig: RigConfig) -> None:
    """Raise ValueError for a rig whose slide and contact are given and whose drive has the default stiffness."""
    is_own = "mass_kg" in rig.slide.model_fields_set and not rig.contact.pair
    if is_own and "stiffness_N_per_m" not in rig.drive.model_fields_set:
        k_d = rig.drive.stiffness_N_per_m
        raise ValueError(
            "drive.stiffness_N_per_m: must be given, as slide.mass_kg and the contact are: the paper's spring of "
            f"{k_d:g} N/m gives by {1e3 * rig.contact.static_force_N / k_d:.2g} mm before this slide breaks away"
        )


def _contact_damping(rig: RigConfig) -> None:
    damping, mass_kg, step_s = rig.contact.damping_Ns_per_m, rig.slide.mass_kg, rig.solver.step_s
    most = _MOST_DAMPING * mass_kg / step_s
    if damping > most:
        raise ValueError(
            f"contact.damping_Ns_per_m = {damping:g}: must be at most {_MOST_DAMPING:g} x slide.mass_kg / solver.step_s, here "
            f"{most:.3g} N s/m, or a vibrated slide moves falsely; lower it (2 sqrt(stiffness x mass) is "
            f"{2.0 * math.sqrt(rig.contact.stiffness_N_per_m * mass_kg):.3g}), or shorten solver.step_s to "
            f"{_MOST_DAMPING * mass_kg / damping:.2g} or less"
        )


def _stribeck_curve(rig: RigConfig) -> None:
    p = build(rig)[0][0]
    gauss = np.exp(-(_VELOCITY_RATIOS**2))
    fall = gauss + p["stribeck_tail"] * (1.0 / (1.0 + _VELOCITY_RATIOS**2) - gauss)
    for coulomb_N in (p["F_c"], p["F_c"] * (1.0 + p["kinetic_backward_ratio"])):
        friction_N = coulomb_N + (p["F_s"] - coulomb_N) * fall
        least = int(np.argmin(friction_N))
        if friction_N[least] <= 0.0:
            raise ValueError(
                f"contact.stribeck_tail = {p['stribeck_tail']:g}: with friction levels of {p['F_s']:.3g} N and "
                f"{coulomb_N:.3g} N (with effects), friction at {_VELOCITY_RATIOS[least]:.2g} times the Stribeck velocity "
                f"would be {friction_N[least]:.3g} N: must stay above 0; raise the tail, or bring the levels closer together"
            )


def _ripple(rig: RigConfig) -> None:
    ripple = rig.effects.get("drive-speed-ripple")
    if ripple is None:
        return
    ratio, sin_2, cos_2 = (float(ripple[key]) for key in ("ratio", "second_sin", "second_cos"))
    wave = np.sin(_ANGLES_RAD) + sin_2 * np.sin(2.0 * _ANGLES_RAD) + cos_2 * np.cos(2.0 * _ANGLES_RAD)
    slowest = 1.0 + ratio * float(wave.min())
    if slowest <= 0.0:
        raise ValueError(
            f"effects.drive-speed-ripple.ratio = {ratio:g}: with second_sin = {sin_2:g} and second_cos = {cos_2:g} the drive "
            f"would go back at {-slowest:.2g} times its speed: it must not stop; lower the ratio below {-1.0 / wave.min():.3g}"
        )
