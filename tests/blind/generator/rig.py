"""The numbers of one rig: the described ones, and the true ones."""

from dataclasses import dataclass

import numpy as np

# paper, Table 1 and 2: steel on steel (C45-C45) at 0.063 N/mm2
DESCRIBED = {
    "mass_kg": 1.5,
    "drive_stiffness_N_per_m": 11700.0,
    "drive_damping_Ns_per_m": 0.0,
    "contact_stiffness_N_per_m": 77.52e6,
    "contact_damping_Ns_per_m": 2.15e4,
    "viscous_damping_Ns_per_m": 0.0,
    "coulomb_force_N": 14.49,
    "static_force_N": 17.38,
    "stribeck_velocity_mps": 0.0005,
}
TOLERANCE = {  # one standard deviation, relative
    "mass_kg": 0.005,
    "drive_stiffness_N_per_m": 0.02,
    "contact_stiffness_N_per_m": 0.05,
    "contact_damping_Ns_per_m": 0.10,
    "coulomb_force_N": 0.03,
    "static_force_N": 0.03,
    "stribeck_velocity_mps": 0.10,
}
ELEMENTS = 4  # bristle elements the kernel has; plain LuGre uses one
BACKBONES = ("lugre", "multi-element", "lorentzian", "stretched")

# one row of float64: the kernel reads it by name, at the cost of a pointer
PARAMS = np.dtype(
    [
        ("mass_kg", "f8"),
        ("drive_stiffness_N_per_m", "f8"),
        ("drive_damping_Ns_per_m", "f8"),
        ("contact_stiffness_N_per_m", "f8"),
        ("contact_damping_Ns_per_m", "f8"),
        ("viscous_damping_Ns_per_m", "f8"),
        ("coulomb_force_N", "f8"),
        ("static_force_N", "f8"),
        ("stribeck_velocity_mps", "f8"),
        # backbone
        ("elements", "f8"),
        ("stiffness_share", "f8", (ELEMENTS,)),  # of the contact stiffness and damping; adds up to 1
        ("force_share", "f8", (ELEMENTS,)),  # of the steady friction force; adds up to 1
        ("lorentzian", "f8"),  # 1: the Stribeck curve is 1 / (1 + r^2)
        ("stribeck_exponent", "f8"),  # otherwise exp(-r^exponent)
        # friction
        ("quadratic_damping_Ns2_per_m2", "f8"),
        ("direction_coulomb", "f8"),
        ("direction_static", "f8"),
        ("ageing", "f8"),  # relative growth of F_s, see kernel._aged
        ("ageing_exponent", "f8"),  # > 0: power law; 0: two time constants
        ("ageing_fast_s", "f8"),
        ("ageing_slow_s", "f8"),
        ("ageing_reset_m", "f8"),
        ("lag_delay_s", "f8"),
        ("lag_distance_m", "f8"),
        ("lag_share", "f8"),  # of the Stribeck curve that lags; the rest follows at once
        ("warming", "f8"),  # growth of the Stribeck velocity with friction work
        ("warming_time_s", "f8"),
        ("acceleration_friction_s2_per_m", "f8"),
        ("preload_growth", "f8"),  # of all friction with friction work
        ("preload_time_s", "f8"),
        ("starvation", "f8"),  # growth of all friction with the distance slid one way
        ("starvation_m", "f8"),
        # drive
        ("spring_cubic", "f8"),  # added relative force at 1 mm, growing as stretch^2
        ("spring_knee", "f8"),  # added relative stiffness beyond spring_knee_m
        ("spring_knee_m", "f8"),
        ("spring_exponential", "f8"),
        ("spring_exponential_m", "f8"),
        ("backlash_m", "f8"),
        ("maxwell_stiffness_N_per_m", "f8"),
        ("maxwell_time_s", "f8"),
        ("clamp_share", "f8"),  # part of the drive stiffness behind a Coulomb slider
        ("clamp_yield_m", "f8"),
        # structure: a mode's receptance is 1 / (modal mass), so 0 is a rigid one
        ("frame_inverse_mass_1_per_kg", "f8"),
        ("frame_omega_radps", "f8"),
        ("frame_damping_ratio", "f8"),
        ("base_inverse_mass_1_per_kg", "f8"),
        ("base_omega_radps", "f8"),
        ("base_damping_ratio", "f8"),
        ("inner_mass_ratio", "f8"),  # a mass on a spring inside the slide
        ("inner_omega_radps", "f8"),
        ("inner_damping_ratio", "f8"),
        # other forces on the slide
        ("seal_force_N", "f8"),
        ("seal_stiffness_N_per_m", "f8"),
        ("guide_force_N", "f8"),  # Coulomb friction of a second guide, next to the vibrated contact
        ("guide_static_share", "f8"),  # by which its static friction is higher
        ("guide_stribeck_mps", "f8"),
        ("guide_stiffness_N_per_m", "f8"),
        ("tilt_N_per_m", "f8"),
        ("tilt_N_per_m2", "f8"),
        ("tilt_centre_m", "f8"),
        ("detent_force_N", "f8"),
        ("detent_wavenumber_radpm", "f8"),
        ("detent_phase_rad", "f8"),
        # piezo
        ("sag_load", "f8"),  # amplitude lost at a drive force of F_s, relative
        ("second_harmonic", "f8"),
        ("subharmonic", "f8"),
    ]
)


@dataclass(frozen=True)
class Start:
    """State of the rig at the start of a run: position of the slide, load of the spring, age of the contact."""

    position_m: float
    force_share: float  # of F_c
    age_s: float


def _draw_numbers(random: np.random.Generator, scale: float) -> dict[str, float]:
    while True:
        numbers = dict(DESCRIBED)
        for name, deviation in TOLERANCE.items():
            normal = random.standard_normal()
            while abs(normal) > 3.0:
                normal = random.standard_normal()
            numbers[name] *= 1.0 + scale * deviation * normal
        if numbers["static_force_N"] > 1.02 * numbers["coulomb_force_N"]:
            return numbers


def _draw_elements(random: np.random.Generator, p: np.ndarray) -> None:
    """Elements of a generalized Maxwell slip with LuGre's rate equation (Lampaert, Al-Bender & Swevers 2003).

    The yield displacements spread by at most a factor of 1.6 either way, so the hysteresis of presliding is rounder. The
    steady force, the total stiffness and the total damping equal the model with one element.
    """
    count = int(random.integers(3, ELEMENTS + 1))
    force = random.uniform(0.7, 1.3, count)
    stiffness = force * np.geomspace(1.0 / random.uniform(1.2, 1.6), random.uniform(1.2, 1.6), count)
    p["elements"] = count
    p["force_share"][0, :count] = force / force.sum()
    p["stiffness_share"][0, :count] = stiffness / stiffness.sum()


def draw_rig(random: np.random.Generator, backbone: str | None, scale: float) -> np.ndarray:
    """One rig as a (1,) array of PARAMS; its numbers are spread by `scale` times their tolerances.

    Without a `backbone`, two draws of three are LuGre with a Gaussian Stribeck curve.
    """
    p = np.zeros(1, PARAMS)
    for name, value in _draw_numbers(random, scale).items():
        p[name] = value
    other = str(random.choice(BACKBONES[1:]))
    drawn = "lugre" if random.random() < 2.0 / 3.0 else other
    exponent = float(random.uniform(1.5, 1.8))
    p["elements"] = 1
    p["stiffness_share"][0, 0] = p["force_share"][0, 0] = 1.0
    p["stribeck_exponent"] = 2.0
    kind = backbone or drawn
    if kind not in BACKBONES:
        raise ValueError(f"backbone = {kind}: must be one of {', '.join(BACKBONES)}")
    if kind == "multi-element":
        _draw_elements(random, p)
    elif kind == "lorentzian":
        p["lorentzian"] = 1.0
    elif kind == "stretched":
        p["stribeck_exponent"] = exponent
    return p


def draw_starts(random: np.random.Generator, count: int) -> list[Start]:
    """One start per run, each on its own piece of the track between 12 and 30 mm."""
    pieces = 0.012 + (random.permutation(count) + random.uniform(0.0, 1.0, count)) * 0.018 / count
    return [
        Start(float(piece), float(random.uniform(0.2, 0.8)), float(np.exp(random.uniform(np.log(0.3), np.log(30.0)))))
        for piece in pieces
    ]
