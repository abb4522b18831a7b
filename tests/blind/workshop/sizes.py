"""Effects of the library in forms and sizes that are clearly large on a bench, in units of the rig.

Numbers are drawn in units of `Rig.units`, so that one effect fits every kind of rig.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from plant.effects.library import EFFECTS
from tests.blind.workshop.rigs import Rig


class Size(NamedTuple):
    """A range of one number at strength 1."""

    low: float
    high: float
    unit: str = ""
    either: bool = False  # of either sign
    fades: float | None = None  # power of the strength in it; None: 1 for the first number of a form, 0 for the others


class Number(NamedTuple):
    """A drawn number at strength 1, in a unit of the rig."""

    name: str
    value: float
    unit: str
    fades: float


@dataclass(frozen=True)
class Drawn:
    """An effect with its numbers."""

    name: str
    form: str
    numbers: tuple[Number, ...]
    strength: float = 1.0

    def scaled(self, strength: float) -> "Drawn":
        """The same effect at another strength: 0 absent, 1 clearly large."""
        return replace(self, strength=strength)

    def values(self, units: dict[str, float]) -> dict[str, float]:
        """The numbers at this strength, above 0, on a rig with these units."""
        return {n.name: n.value * units[n.unit] * self.strength**n.fades for n in self.numbers}


def drawn(random: np.random.Generator, name: str, form: str, sizes: dict[str, Size]) -> Drawn:
    """An effect at full strength."""
    numbers = []
    for place, (key, size) in enumerate(sizes.items()):
        sign = random.choice((-1.0, 1.0)) if size.either else 1.0
        fades = float(place == 0) if size.fades is None else size.fades
        numbers.append(Number(key, float(sign * random.uniform(size.low, size.high)), size.unit, fades))
    return Drawn(name, form, tuple(numbers))


_PHASE = Size(0.0, 6.28)
_WAVE = {"phase_rad": _PHASE, "second_sin": Size(0.0, 0.35, either=True), "second_cos": Size(0.0, 0.35, either=True)}
_SEED = Size(0.0, 1e6)
_PART = Size(0.5, 1.0)
_SWING = Size(0.06, 0.15)
_ALONG = Size(0.7, 6.0, "slip")
_RATE = Size(0.4, 3.0)
_UNEVEN = Size(0.2, 0.5)
_PITCH = Size(0.4, 3.0, "slip")
_LIGHT = Size(0.02, 0.15)  # damping ratio of a metal structure
_SUPPORT_HZ = Size(3.0, 9.0, "swing_Hz")
_ONE = {"ratio": Size(0.12, 0.3, either=True)}

SIZES: dict[str, tuple[tuple[str, dict[str, Size]], ...]] = {
    "static-friction-ageing": (
        ("log", {"ratio": Size(0.02, 0.05), "age_scale_s": Size(0.02, 0.3), "rested_s": Size(0.0, 2.0)}),
        ("power", {"ratio": Size(0.08, 0.2), "exponent": Size(0.2, 0.5), "rested_s": Size(0.0, 1.5)}),
        ("settling", {"ratio": Size(0.08, 0.25), "settling_s": Size(0.2, 1.5), "rested_s": Size(0.0, 2.0)}),
    ),
    "frictional-lag": (
        ("time", {"lag_s": Size(0.1, 0.35, "swing_s")}),
        ("dead-time", {"delay_s": Size(0.1, 0.35, "swing_s"), "share": _PART}),
        ("distance", {"distance_m": Size(0.01, 0.06, "slip"), "share": _PART}),
    ),
    "viscous-friction": (
        ("linear", {"damping_Ns_per_m": Size(0.06, 0.15, "critical")}),
        ("quadratic", {"damping_Ns2_per_m2": Size(0.12, 0.35, "critical/speed")}),
    ),
    "position-dependent-friction": (
        ("wave", {"ratio": _SWING, "wavelength_m": _ALONG, **_WAVE}),
        (
            "two-waves",
            {
                "ratio": _SWING, "wavelength_m": _ALONG, "phase_rad": _PHASE, "other_share": Size(0.4, 1.0),
                "other_wavelength_m": Size(0.2, 0.9, "slip"), "other_phase_rad": _PHASE,
            },
        ),
        ("bumps", {"ratio": Size(0.12, 0.25, either=True), "wavelength_m": _ALONG, "phase_rad": _PHASE,
                   "width": Size(0.06, 0.2)}),
        ("random", {"ratio": _SWING, "wavelength_m": _ALONG, "seed": _SEED}),
    ),
    "direction-dependent-friction": tuple(
        (form, {"ratio": Size(0.1, 0.22, either=True)}) for form in ("backward", "both", "kinetic")
    ),
    "normal-load-fluctuation": (
        ("sine", {"ratio": _SWING, "frequency_Hz": _RATE, **_WAVE}),
        ("random", {"ratio": _SWING, "frequency_Hz": _RATE, "seed": _SEED}),
    ),
    "friction-drift": (
        ("linear", {"rate_per_s": Size(0.008, 0.02, either=True)}),
        ("settling", {"ratio": Size(0.1, 0.22, either=True), "settling_s": Size(1.5, 6.0)}),
        # before_s is the time since the bench was switched on, which the run gives
        ("session", {"ratio": Size(0.15, 0.3, either=True), "settling_s": Size(15.0, 60.0)}),
    ),
    "coulomb-level": (("", {"ratio": Size(-0.2, -0.12)}), ("", {"ratio": Size(0.35, 0.6, "drop/F_c")})),
    "static-level": (("", {"ratio": Size(0.12, 0.2)}), ("", {"ratio": Size(-0.6, -0.4, "drop/F_s")})),
    "stribeck-velocity": (("", {"ratio": Size(1.2, 3.0)}), ("", {"ratio": Size(-0.8, -0.6)})),
    "drive-damping": (
        ("viscous", {"damping_Ns_per_m": Size(0.06, 0.2, "critical")}),
        ("relaxing", {"damping_Ns_per_m": Size(0.08, 0.3, "critical"), "relaxation_s": Size(0.2, 1.0, "swing_s")}),
    ),
    "drive-stiffness": (("", _ONE),),
    "drive-hardening": (
        ("cubic", {"ratio": Size(0.15, 0.45, "per mm2")}),
        ("bilinear", {"ratio": Size(0.3, 0.8), "knee_m": Size(0.4, 0.85, "stretch")}),
        ("bilinear", {"ratio": Size(-0.5, -0.3), "knee_m": Size(0.4, 0.85, "stretch")}),
    ),
    "drive-backlash": (("", {"gap_m": Size(0.1, 0.35, "stretch")}),),
    "drive-speed-ripple": (
        ("screw", {"ratio": _UNEVEN, "wavelength_m": _PITCH, **_WAVE}),
        ("time", {"ratio": _UNEVEN, "frequency_Hz": Size(0.5, 6.0), **_WAVE}),
        ("load", {"ratio": _UNEVEN, "wavelength_m": _PITCH, **_WAVE}),
    ),
    "frame-compliance": (("", {"ratio": Size(0.15, 0.4), "frequency_Hz": _SUPPORT_HZ, "damping_ratio": _LIGHT}),),
    "base-compliance": (
        ("", {"compliance_m_per_N": Size(0.12, 0.4, "1/k_d"), "frequency_Hz": _SUPPORT_HZ, "damping_ratio": _LIGHT}),
    ),
    # an exciter is perfect if its corner or resonance is far above every tone
    "piezo-roll-off": (
        ("first-order", {"corner_Hz": Size(0.5, 1.1, "top_Hz", fades=-0.5)}),
        ("second-order", {"corner_Hz": Size(0.8, 1.6, "top_Hz", fades=-0.5)}),
    ),
    "piezo-resonance": (
        ("mount", {"resonance_Hz": Size(1.3, 1.9, "top_Hz", fades=-0.5), "damping_ratio": _LIGHT}),
        ("mode", {"ratio": Size(0.3, 1.0), "resonance_Hz": Size(0.5, 1.2, "top_Hz"), "damping_ratio": _LIGHT}),
    ),
    "piezo-sag": (
        ("load", {"ratio": Size(0.2, 0.5)}),
        ("heat", {"ratio": Size(0.25, 0.5), "settling_s": Size(0.5, 3.0)}),
    ),
    "force-sensor-gain": (("", {"ratio": Size(0.08, 0.2, either=True)}),),
    "force-sensor-bias": (("", {"bias_N": Size(0.05, 0.15, "F_s", either=True)}),),
    "force-sensor-drift": (
        ("linear", {"rate_N_per_s": Size(0.008, 0.025, "F_s", either=True)}),
        ("settling", {"drift_N": Size(0.08, 0.2, "F_s", either=True), "settling_s": Size(1.0, 5.0)}),
    ),
    "force-sensor-lag": (
        ("first-order", {"lag_s": Size(0.15, 0.6, "swing_s")}),
        ("second-order", {"lag_s": Size(0.1, 0.35, "swing_s")}),
        ("fourth-order", {"lag_s": Size(0.06, 0.18, "swing_s")}),
    ),
    "force-sensor-delay": (("", {"delay_s": Size(0.15, 0.4, "swing_s")}),),
    "accelerometer-gain": tuple((form, _ONE) for form in ("both", "mass", "base")),
}  # fmt: skip


def of_library(effect: Drawn, rig: Rig, begun_s: float) -> dict[str, float | str]:
    """An effect's table in a rig file; `begun_s` since the bench was switched on."""
    limits = {parameter.name: parameter.high for parameter in EFFECTS[effect.name].forms[effect.form].parameters}
    table: dict[str, float | str] = {"form": effect.form, **effect.values(rig.units)}
    for number in effect.numbers:
        if number.fades < 0.0:  # fades away upwards: at the limit it is absent
            table[number.name] = min(float(table[number.name]), limits[number.name])
    return table | ({"before_s": begun_s} if "before_s" in limits else {})
