"""Delivered share of the commanded amplitude: over frequency, under load, and during warm-up.

Source of the form `mode`, one mode in parallel with a rigid path: Ewins, Modal Testing, 2000.
"""

import math
from typing import Any, Final

from bridge.kernel import kernel
from bridge.layouts import PlantParams
from plant.effects.row import Effect, Formula, Parameter, ratio


@kernel
def roll_off(p: PlantParams, frequency_Hz: float) -> float:
    """Factor by which the roll-off divides the amplitude at this frequency."""
    r = frequency_Hz / p.rolloff_Hz
    return math.sqrt(1.0 + r * r) if p.rolloff_order == 1.0 else 1.0 + r * r


@kernel
def mode_gain(mode_ratio: float, r: float, damped: float, squared: float) -> float:
    """Gain of a rigid path in parallel with a mode of a given share.

    Args:
        mode_ratio: the share.
        r: frequency over the mode's frequency; damped: 2 damping_ratio r; squared: (1 - r^2)^2 + damped^2.

    """
    moved = mode_ratio * r * r / squared
    return math.hypot(1.0 + moved * (1.0 - r * r), moved * damped)


@kernel
def heat_share(p: PlantParams, vibrating_s: float) -> float:
    """Remaining share of the amplitude after this time of vibration."""
    return 1.0 - p.sag_ratio * (1.0 - math.exp(-vibrating_s / p.sag_settling_s))


@kernel
def load_share(sag_per_N: float, force_N: float) -> float:
    """Remaining share of the amplitude under this drive force."""
    return max(1.0 - sag_per_N * math.fabs(force_N), 0.0)


def _set_roll_off(p: Any, form: str, value: dict[str, float]) -> None:
    p.rolloff_Hz, p.rolloff_order = value["corner_Hz"], 1.0 if form == "first-order" else 2.0


def _set_resonance(p: Any, form: str, value: dict[str, float]) -> None:
    p.mount_resonance_Hz, p.mount_damping_ratio = value["resonance_Hz"], value["damping_ratio"]
    if form == "mode":
        p.mode_ratio = value["ratio"]
        p.mount_resonance_Hz *= value["ratio"] > 0.0  # a mode of share 0 leaves a rigid mount


_MODE = (Parameter("resonance_Hz", 100.0, 1e6, 8000.0), Parameter("damping_ratio", 0.005, 2.0, 0.05))
_SAG = ratio(0.2, -0.9, 0.9)
PIEZO: Final = {
    "piezo-roll-off": Effect(
        "piezo",
        {
            "first-order": Formula(
                "amplitude / sqrt(1 + (f / corner_Hz)^2)", (Parameter("corner_Hz", 50.0, 1e7, 3000.0),)
            ),
            "second-order": Formula(
                "amplitude / (1 + (f / corner_Hz)^2)", (Parameter("corner_Hz", 50.0, 1e7, 5000.0),)
            ),
        },
        _set_roll_off,
        numbers=("rolloff_Hz", "rolloff_order"),
    ),
    "piezo-resonance": Effect(
        "piezo",
        {
            "mount": Formula("amplitude times the gain of a mass on a spring, in place of the rig's mount", _MODE),
            "mode": Formula(
                "amplitude times |1 + ratio r^2 / (1 - r^2 + 2 i damping_ratio r)|, r = f / resonance_Hz, not the rig's mount",
                (ratio(0.3, 0.0, 10.0), *_MODE),
            ),
        },
        _set_resonance,
        numbers=("mode_ratio",),
    ),
    "piezo-sag": Effect(
        "piezo",
        {
            "load": Formula("amplitude times 1 - ratio |F_d| / F_s", (_SAG,)),
            "heat": Formula(
                "amplitude times 1 - ratio (1 - exp(-t / settling_s)), t since the piezo was switched on",
                (_SAG, Parameter("settling_s", 0.05, 1e4, 3.0)),
            ),
        },
        prefix="sag_",
        memory=(("vibrating_s", "f8"),),
    ),
}
