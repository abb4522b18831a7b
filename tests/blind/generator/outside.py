"""Effects of real rigs outside the mechanisms of the library."""

import numpy as np
from scipy.interpolate import CubicSpline

from tests.blind.generator.effect import Formula, Numbers, Signals, either, noise_of, noise_seed, scales
from tests.blind.generator.kernel import SAMPLE_RATE_HZ
from tests.blind.generator.runs import Tracks

Random = np.random.Generator


def _clock(signals: Signals, s: float, n: Numbers) -> None:
    """Two recorders, one of them timed by software: the accelerations drift away in time from the other signals.

    Cubic splines interpolate, as straight lines would take 13 % off a vibration at 4.5 kHz.
    """
    own_s = np.minimum(signals["t_s"] * (1.0 + s * n["skew"]), signals["t_s"][-1])
    for column in ("mass_accel_mps2", "base_accel_mps2"):
        signals[column] = CubicSpline(signals["t_s"], signals[column])(own_s)


def _compression(signals: Signals, s: float, n: Numbers) -> None:
    """The force amplifier saturates: above the knee each further newton shows less."""
    force = signals["drive_force_N"]
    over = np.maximum(np.abs(force) - n["knee_N"], 0.0)
    share = np.minimum(s * n["share"], 1.0)
    signals["drive_force_N"] = force - np.sign(force) * share * (over - n["width_N"] * np.tanh(over / n["width_N"]))


def _coupling_slip(tracks: Tracks, s: float, n: Numbers) -> None:
    """A clamp between drive sensor and spring slips at random times; the spring's end jumps back within 5 ms."""
    random = noise_of(n, tracks.number)
    count = random.poisson(n["per_second"] * tracks.t_s[-1]) + 1
    direction = np.sign(tracks.drive_mps)
    for at_s, size in zip(random.uniform(0.0, tracks.t_s[-1], count), random.uniform(0.5, 1.5, count), strict=True):
        ramp = np.clip((tracks.t_s - at_s) / 5e-3, 0.0, 1.0)
        back = direction[int(at_s * SAMPLE_RATE_HZ)]
        tracks.unseen_m -= back * s * n["jump_m"] * size * ramp * ramp * (3.0 - 2.0 * ramp)


def _debris(tracks: Tracks, s: float, n: Numbers) -> None:
    """A particle gets into the contact, ploughs for some ten milliseconds and leaves."""
    random = noise_of(n, tracks.number)
    count = random.poisson(n["per_second"] * tracks.t_s[-1]) + 1
    for at_s in random.uniform(0.0, tracks.t_s[-1], count):
        width_s, height = random.uniform(0.02, 0.08), min(random.exponential(), 2.5) * n["height"]
        tracks.load += s * height * np.exp(-0.5 * ((tracks.t_s - at_s) / width_s) ** 2)


def _cross_talk(signals: Signals, s: float, n: Numbers) -> None:
    """The piezo's voltage couples into the force cable as through a capacitor, in proportion to its slope."""
    share = signals["base_accel_mps2"] / (2.0 * np.pi * 3000.0) ** 2 / 0.02e-6  # about 1 at 3 kHz, as f^2
    signals["drive_force_N"] += s * n["pick_up_N"] * share


def _drop_outs(signals: Signals, s: float, n: Numbers) -> None:
    """A loose plug: the force signal falls towards zero for some milliseconds."""
    start_nm = int(1e9 * signals["mass_position_m"][0])  # differs from run to run, so it serves as the run's number
    random = noise_of(n, start_nm)
    keep = np.ones(len(signals["t_s"]))
    count = random.poisson(n["per_second"] * signals["t_s"][-1]) + 1
    for at_s in random.uniform(0.0, signals["t_s"][-1], count):
        begin = int(at_s * SAMPLE_RATE_HZ)
        keep[begin : begin + int(random.uniform(0.004, 0.02) * SAMPLE_RATE_HZ)] = max(0.0, 1.0 - s)
    signals["drive_force_N"] *= keep


OUTSIDE_FORMULAS = (
    Formula("clock-skew", "linear", lambda r: {"skew": either(r) * r.uniform(4e-4, 1e-3)}, sense=_clock),
    Formula(
        "force-amplifier-compression",
        "knee",
        lambda r: {"knee_N": r.uniform(9.0, 12.0), "width_N": r.uniform(0.3, 1.0), "share": r.uniform(0.5, 0.9)},
        sense=_compression,
    ),
    # friction that is higher while speeding up than while slowing down (McMillan 1997)
    Formula(
        "acceleration-dependent-friction",
        "one-sided",
        lambda r: {"acceleration_friction_s2_per_m": r.uniform(0.02, 0.05)},
        rig=scales("acceleration_friction_s2_per_m"),
    ),
    # the wiper of the guide: a soft contact that breaks away after tens of micrometres and does not vibrate with the base
    Formula(
        "guide-seal",
        "parallel-contact",
        lambda r: {"seal_force_N": r.uniform(1.2, 2.5), "seal_stiffness_N_per_m": r.uniform(1e4, 6e4)},
        rig=scales("seal_force_N", keeps=("seal_stiffness_N_per_m",)),
    ),
    Formula(
        "coupling-slip",
        "random-jumps",
        lambda r: {"per_second": r.uniform(0.4, 1.0), "jump_m": r.uniform(60e-6, 120e-6), "seed": noise_seed(r)},
        run=_coupling_slip,
    ),
    # 1 to 2 N between the ends of the track: a track that sags by some millimetres in a metre
    Formula(
        "track-tilt",
        "quadratic",
        lambda r: {
            "tilt_N_per_m": either(r) * r.uniform(40.0, 80.0),
            "tilt_N_per_m2": either(r) * r.uniform(5e3, 1e4),
            "tilt_centre_m": r.uniform(0.018, 0.024),
        },
        rig=scales("tilt_N_per_m", "tilt_N_per_m2", keeps=("tilt_centre_m",)),
    ),
    Formula(
        "work-heated-lubricant",
        "stribeck-velocity-grows",
        lambda r: {"warming": r.uniform(1.0, 2.0), "warming_time_s": r.uniform(1.0, 3.0)},
        rig=scales("warming", keeps=("warming_time_s",)),
    ),
    # Jenkins element in parallel to the spring (Gaul & Nitsche 2001)
    Formula(
        "loose-clamp",
        "jenkins",
        lambda r: {"clamp_share": r.uniform(0.25, 0.4), "clamp_yield_m": r.uniform(0.08e-3, 0.25e-3)},
        rig=scales("clamp_share", keeps=("clamp_yield_m",)),
    ),
    Formula(
        "piezo-harmonics",
        "second-and-half",
        lambda r: {"second_harmonic": either(r) * r.uniform(0.2, 0.4), "subharmonic": r.uniform(0.3, 0.6)},
        rig=scales("second_harmonic", "subharmonic"),
    ),
    # cogging of a linear motor: pulls the slide to fixed places on the track in both directions
    Formula(
        "magnet-detent",
        "sine",
        lambda r: {
            "detent_force_N": r.uniform(0.5, 1.0),
            "detent_wavenumber_radpm": 2.0 * np.pi / r.uniform(0.7e-3, 3e-3),
            "detent_phase_rad": r.uniform(0.0, 2.0 * np.pi),
        },
        rig=scales("detent_force_N", keeps=("detent_wavenumber_radpm", "detent_phase_rad")),
    ),
    Formula(
        "debris-bursts",
        "gaussian",
        lambda r: {"per_second": r.uniform(1.0, 3.0), "height": r.uniform(0.15, 0.3), "seed": noise_seed(r)},
        run=_debris,
    ),
    Formula(
        "inner-mass",
        "spring-inside-slide",
        lambda r: {
            "inner_mass_ratio": r.uniform(0.25, 0.5),
            "inner_omega_radps": 2.0 * np.pi * r.uniform(20.0, 60.0),
            "inner_damping_ratio": r.uniform(0.01, 0.03),
        },
        rig=scales("inner_mass_ratio", keeps=("inner_omega_radps", "inner_damping_ratio")),
    ),
    Formula(
        "piezo-cross-talk", "capacitive", lambda r: {"pick_up_N": either(r) * r.uniform(0.3, 0.8)}, sense=_cross_talk
    ),
    Formula(
        "force-drop-outs",
        "loose-plug",
        lambda r: {"per_second": r.uniform(1.0, 3.0), "seed": noise_seed(r)},
        sense=_drop_outs,
    ),
)
OUTSIDE = tuple(formula.effect for formula in OUTSIDE_FORMULAS)
