"""The range of sizes of each effect: from barely visible in the protocol "ladder" on the paper's rig to large.

At the lower end, simple features of the cycles (largest and smallest force, peak acceleration, spring fit) move by roughly
2 to 15 of their standard errors against the same rig without the effect; a diagnosis that does not know the rig sees less.
Levels and stiffnesses start where their tolerances end. Least certain are frictional lag and Stribeck velocity (6 standard
errors at 20 ms and at four times nominal, hence the wide ranges), speed ripple and backward friction (those features do not
show them), force delay, and the gains of force sensor and accelerometer (a guess; a small gain hides in the tolerances).
No resonance inside the band of the piezo is ever drawn.
"""

import math
from typing import Final, NamedTuple

from plant.effects.library import EFFECTS

TURN: Final = (0.0, 2.0 * math.pi)


class Sizes(NamedTuple):
    """One form of an effect: its size goes log-uniformly from the first number to the second, which may be smaller."""

    form: str
    parameter: str  # the size
    barely: float
    large: float
    signs: tuple[float, ...] = (1.0,)
    log: dict[str, tuple[float, float]] = {}  # other parameters, log-uniform
    even: dict[str, tuple[float, float]] = {}  # other parameters, uniform


BOTH_SIGNS = (-1.0, 1.0)
DAMPING = {"damping_ratio": (0.02, 0.2)}

EFFECT_SIZES: Final[dict[str, tuple[Sizes, ...]]] = {
    "static-friction-ageing": (
        # dwells of 0.25 to 3 s: ln(12) = 2.5 ratios between the shortest and the longest
        Sizes("log", "ratio", 0.004, 0.06, log={"age_scale_s": (0.01, 1.0)}),
        Sizes("power", "ratio", 0.01, 0.12, log={"exponent": (0.1, 0.5)}),
        Sizes("settling", "ratio", 0.01, 0.12, log={"settling_s": (0.2, 2.0)}),
    ),
    "frictional-lag": (
        Sizes("time", "lag_s", 1e-3, 1e-1),
        Sizes("dead-time", "share", 0.05, 1.0, log={"delay_s": (3e-4, 1e-2)}),
        Sizes("distance", "share", 0.03, 0.6, log={"distance_m": (1e-6, 1e-5)}),
    ),
    # a slip reaches 22 mm/s; sqrt(k m) = 132 N s/m
    "viscous-friction": (
        Sizes("linear", "damping_Ns_per_m", 2.0, 40.0),
        Sizes("quadratic", "damping_Ns2_per_m2", 100.0, 3000.0),
    ),
    "position-dependent-friction": (
        Sizes("wave", "ratio", 0.004, 0.08, log={"wavelength_m": (5e-4, 5e-3)}, even={"phase_rad": TURN}),
        Sizes(
            *("two-waves", "ratio", 0.004, 0.08),
            log={"wavelength_m": (1.5e-3, 5e-3), "other_wavelength_m": (5e-4, 1.5e-3)},
            even={"phase_rad": TURN, "other_share": (0.4, 1.0), "other_phase_rad": TURN},
        ),
        Sizes(
            *("bumps", "ratio", 0.008, 0.16, BOTH_SIGNS),
            log={"wavelength_m": (1e-3, 5e-3)},
            even={"phase_rad": TURN, "width": (0.06, 0.2)},
        ),
        Sizes("random", "ratio", 0.004, 0.08, log={"wavelength_m": (5e-4, 5e-3)}, even={"seed": (1.0, 1e5)}),
    ),
    "direction-dependent-friction": (
        Sizes("backward", "ratio", 0.01, 0.2, BOTH_SIGNS),
        Sizes("both", "ratio", 0.01, 0.2, BOTH_SIGNS),
        Sizes("kinetic", "ratio", 0.01, 0.2, BOTH_SIGNS),
    ),
    "normal-load-fluctuation": (
        Sizes("sine", "ratio", 0.004, 0.08, log={"frequency_Hz": (0.3, 20.0)}, even={"phase_rad": TURN}),
        Sizes("random", "ratio", 0.004, 0.08, log={"frequency_Hz": (0.5, 10.0)}, even={"seed": (1.0, 1e5)}),
    ),
    "friction-drift": (
        Sizes("linear", "rate_per_s", 5e-4, 1e-2, BOTH_SIGNS),
        Sizes("settling", "ratio", 0.01, 0.15, BOTH_SIGNS, log={"settling_s": (1.0, 10.0)}),
        Sizes("session", "ratio", 0.01, 0.15, BOTH_SIGNS, log={"settling_s": (5.0, 30.0)}),
    ),
    # beyond 2.5 tolerances; stick-slip ends where the Coulomb force meets the static one, 20 % up or 17 % down
    "coulomb-level": (Sizes("", "ratio", 0.08, 0.3, (-1.0,)), Sizes("", "ratio", 0.08, 0.14)),
    "static-level": (Sizes("", "ratio", 0.08, 0.3), Sizes("", "ratio", 0.08, 0.12, (-1.0,))),
    "stribeck-velocity": (Sizes("", "ratio", 0.4, 8.0), Sizes("", "ratio", 0.4, 0.9, (-1.0,))),
    "drive-damping": (
        Sizes("viscous", "damping_Ns_per_m", 1.0, 30.0),
        Sizes("relaxing", "damping_Ns_per_m", 2.0, 60.0, log={"relaxation_s": (1e-3, 1e-2)}),
    ),
    "drive-stiffness": (Sizes("", "ratio", 0.06, 0.3, BOTH_SIGNS),),
    # the spring works between 0.9 and 1.5 mm
    "drive-hardening": (
        Sizes("cubic", "ratio", 0.003, 0.15),
        Sizes("bilinear", "ratio", 0.01, 0.3, log={"knee_m": (5e-4, 1.2e-3)}),
    ),
    "drive-backlash": (Sizes("", "gap_m", 1e-5, 3e-4),),
    "drive-speed-ripple": (
        Sizes("screw", "ratio", 0.01, 0.3, log={"wavelength_m": (5e-4, 5e-3)}, even={"phase_rad": TURN}),
        Sizes("time", "ratio", 0.01, 0.3, log={"frequency_Hz": (0.2, 5.0)}, even={"phase_rad": TURN}),
        Sizes("load", "ratio", 0.01, 0.3, log={"wavelength_m": (5e-4, 5e-3)}, even={"phase_rad": TURN}),
    ),
    "frame-compliance": (Sizes("", "ratio", 0.02, 0.3, log={"frequency_Hz": (30.0, 300.0), **DAMPING}),),
    # a drop of 4 N shakes a base of 150 Hz with 0.03 m/s^2 at 1e-8 m/N
    "base-compliance": (Sizes("", "compliance_m_per_N", 2e-9, 3e-7, log={"frequency_Hz": (60.0, 400.0), **DAMPING}),),
    "piezo-roll-off": (
        Sizes("first-order", "corner_Hz", 2e4, 2e3),
        Sizes("second-order", "corner_Hz", 2.5e4, 3e3),
    ),
    "piezo-resonance": (
        Sizes("mount", "resonance_Hz", 3e4, 5.5e3, log=DAMPING),
        Sizes("mode", "ratio", 0.01, 1.0, log=DAMPING | {"resonance_Hz": (5e3, 1e4)}),
    ),
    "piezo-sag": (
        Sizes("load", "ratio", 0.03, 0.5),
        Sizes("heat", "ratio", 0.03, 0.5, log={"settling_s": (0.5, 5.0)}),
    ),
    "force-sensor-gain": (Sizes("", "ratio", 0.01, 0.15, BOTH_SIGNS),),
    "force-sensor-bias": (Sizes("", "bias_N", 0.05, 2.0, BOTH_SIGNS),),
    "force-sensor-drift": (
        Sizes("linear", "rate_N_per_s", 0.005, 0.2, BOTH_SIGNS),
        Sizes("settling", "drift_N", 0.05, 2.0, BOTH_SIGNS, log={"settling_s": (1.0, 10.0)}),
    ),
    "force-sensor-lag": (
        Sizes("first-order", "lag_s", 1e-4, 5e-3),
        Sizes("second-order", "lag_s", 5e-5, 2.5e-3),
        Sizes("fourth-order", "lag_s", 2.5e-5, 1.25e-3),
    ),
    "force-sensor-delay": (Sizes("", "delay_s", 1e-4, 8e-3),),
    "accelerometer-gain": (
        Sizes("mass", "ratio", 0.01, 0.2, BOTH_SIGNS),
        Sizes("both", "ratio", 0.01, 0.2, BOTH_SIGNS),
        Sizes("base", "ratio", 0.01, 0.2, BOTH_SIGNS),
    ),
}


def possible(drive: str, vibrated: bool) -> list[str]:
    """Effects that a protocol with such a drive, with or without vibration, can show at all."""
    names = [name for name in EFFECT_SIZES if drive in EFFECTS[name].drives]
    if not vibrated:
        names = [name for name in names if EFFECTS[name].acts_on != "piezo"]
    # an axis has no accelerometer in its files, and nothing that shakes with its base
    return [name for name in names if drive == "spring" or name not in {"accelerometer-gain", "base-compliance"}]
