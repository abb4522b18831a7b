"""Effects of the drive: its spring, its damping, and the ripple of its motion.

Sources: hardening and ripple as in Armstrong-Helouvry, Dupont & Canudas de Wit 1994; once a turn of a screw: the travel variation
v_2pi of ISO 3408-3. Form `load`: a nut or thrust bearing that sits askew is a compliance c (1 + s w(angle)) between screw and
drive. Its uneven part yields by F_d c s w. Where F_d changes little within a turn, the drive's velocity swings by a share
F_d c s 2 pi / wavelength: the swing grows with the load, and an unloaded drive runs evenly.
"""

import math
from typing import Any, Final

from bridge.kernel import kernel
from bridge.layouts import PlantParams
from plant.effects.row import WAVE_SHAPE, Effect, Formula, Parameter, one_form, ratio
from plant.effects.waves import TWO_PI, wave

_EVENED = 200  # rounds of `even_m` with half steps: whole steps diverge if the speed more than doubles
_HALVINGS = 44  # bisections of `extension_m`: 10 / 2^44 = 6e-13 of a linear spring's extension is left
MOST_UNEVEN: Final = 0.95  # largest relative ripple of the velocity; below 1, so that the drive never stops


@kernel
def spring_law_N(
    k_d: float,
    slack_m: float,
    yield_m: float,
    hardening_per_m2: float,
    knee_m: float,
    knee_ratio: float,
    extension_m: float,
) -> float:
    """Force of a spring with backlash, hardening and a knee, without a branch: for kernels of one rig and of several."""
    e = extension_m - min(max(extension_m, -slack_m), slack_m)
    e = min(max(e, -yield_m), yield_m)
    knee_N = knee_ratio * k_d * (e - min(max(e, -knee_m), knee_m))
    return k_d * e * (1.0 + hardening_per_m2 * e * e) + knee_N


@kernel
def yield_m(hardening_per_m2: float) -> float:
    """Extension [m] of a softening spring at its largest force: beyond it the cubic law falls; infinite for other springs."""
    return math.sqrt(-1.0 / (3.0 * hardening_per_m2)) if hardening_per_m2 < 0.0 else math.inf


@kernel
def spring_N(p: PlantParams, extension_m: float) -> float:
    """Force of the drive's spring at an extension [N]."""
    most_m = yield_m(p.hardening_per_m2)
    return spring_law_N(p.k_d, 0.5 * p.gap_m, most_m, p.hardening_per_m2, p.knee_m, p.knee_ratio, extension_m)


@kernel
def extension_m(p: PlantParams, force_N: float) -> float:
    """Extension of the drive's spring at a force: by bisection, to 1e-12 of the extension of a linear spring.

    The softest spring, bilinear with a ratio of -0.9, is extended ten times as far.
    """
    result_m = 0.0
    step_m = 10.0 * force_N / p.k_d + math.copysign(0.5 * p.gap_m, force_N)
    for _ in range(_HALVINGS):
        step_m *= 0.5
        if math.fabs(spring_N(p, result_m + step_m)) < math.fabs(force_N):
            result_m += step_m
    return result_m


@kernel
def unevenness(p: PlantParams, t_s: float, even_m: float, force_N: float) -> float:
    """Velocity of an uneven drive under a drive force, divided by the velocity of an even drive at `even_m`."""
    turns = p.ripple_frequency_Hz * t_s
    if p.ripple_wavelength_m > 0.0:
        turns = even_m / p.ripple_wavelength_m
    angle_rad = TWO_PI * turns + p.ripple_phase_rad
    size = min(p.ripple_ratio + p.ripple_per_N * math.fabs(force_N), MOST_UNEVEN)
    return 1.0 + size * wave(angle_rad, p.ripple_second_sin, p.ripple_second_cos)


@kernel
def even_m(p: PlantParams, drive_m: float) -> float:
    """Position of an even drive when a drive with a screw's lead errors is at `drive_m`.

    The errors are the integral of the velocity's ripple over the even position, without a mean. Those under load depend on the
    forces so far and are left out: they change `drive_m` by at most ratio wavelength / 2 pi.
    """
    result_m = drive_m
    if p.ripple_wavelength_m > 0.0:
        per_rad_m = p.ripple_wavelength_m / TWO_PI
        for _ in range(_EVENED):
            sin = math.sin(result_m / per_rad_m + p.ripple_phase_rad)
            cos = math.cos(result_m / per_rad_m + p.ripple_phase_rad)
            error = p.ripple_second_cos * sin * cos - cos - 0.5 * p.ripple_second_sin * (2.0 * cos * cos - 1.0)
            result_m += 0.5 * (drive_m - p.ripple_ratio * per_rad_m * error - result_m)
    return result_m


def _set_damping(p: Any, form: str, value: dict[str, float]) -> None:
    if form == "viscous":
        p.h_d += value["damping_Ns_per_m"]
    else:
        p.relaxing_Ns_per_m, p.relaxation_s = value["damping_Ns_per_m"], value["relaxation_s"]


def _set_hardening(p: Any, form: str, value: dict[str, float]) -> None:
    p.hardening_per_m2 = value["ratio"] * 1e6 if form == "cubic" else 0.0
    p.knee_m, p.knee_ratio = value.get("knee_m", 0.0), value["ratio"] if form == "bilinear" else 0.0


def _set_ripple(p: Any, form: str, value: dict[str, float]) -> None:
    if form == "load":
        p.ripple_ratio, p.ripple_per_N = 0.0, value["ratio"] / p.F_s


_SPRING = ("spring",)
_DAMPING = Parameter("damping_Ns_per_m", 0.0, 1e6, 10.0)
_UNEVEN = ratio(0.05, 0.0, MOST_UNEVEN)
_PITCH = Parameter("wavelength_m", 1e-8, 1e3, 1e-3)
DRIVE: Final = {
    "drive-damping": Effect(
        "drive",
        {
            "viscous": Formula("h_d grows by damping", (_DAMPING,)),
            "relaxing": Formula(
                "a damper in series with a second spring, damping / relaxation_s, parallel to the first (Maxwell)",
                (_DAMPING, Parameter("relaxation_s", 1e-4, 100.0, 4e-3)),
            ),
        },
        _set_damping,
        numbers=("relaxing_Ns_per_m", "relaxation_s"),
        switches=("relaxing_Ns_per_m",),
        memory=(("arm_N", "f8"),),
        drives=_SPRING,
    ),
    "drive-stiffness": Effect(
        "drive", one_form("k_d times 1 + ratio", ratio(0.1)), scales="k_d", drives=_SPRING, first=True
    ),
    "drive-hardening": Effect(
        "drive",
        {
            "cubic": Formula(
                "k_d e (1 + ratio (e / 1 mm)^2); a softening spring yields at its largest force",
                (ratio(0.05, -0.2, 1e6),),
            ),
            "bilinear": Formula(
                "k_d e, beyond |e| = knee_m with the stiffness k_d (1 + ratio)",
                (ratio(0.2), Parameter("knee_m", 1e-6, 1.0, 1e-3)),
            ),
        },
        _set_hardening,
        numbers=("hardening_per_m2", "knee_m", "knee_ratio"),
        switches=("hardening_per_m2", "knee_ratio"),
        drives=_SPRING,
    ),
    "drive-backlash": Effect(
        "drive",
        one_form("no force over a gap of gap_m around e = 0", Parameter("gap_m", 0.0, 0.1, 1e-4)),
        prefix="",
        drives=_SPRING,
    ),
    "drive-speed-ripple": Effect(
        "drive",
        {
            "screw": Formula(
                "drive velocity times 1 + ratio w(2 pi s_e / wavelength_m + phase): the motor turns evenly",
                (_UNEVEN, _PITCH, *WAVE_SHAPE),
            ),
            "time": Formula(
                "drive velocity times 1 + ratio w(2 pi frequency_Hz t + phase)",
                (_UNEVEN, Parameter("frequency_Hz", 1e-3, 1e3, 1.0), *WAVE_SHAPE),
            ),
            "load": Formula(
                "as screw, with ratio |F_d| / F_s (at most 0.95) in place of ratio: without load the drive runs evenly",
                (_UNEVEN, _PITCH, *WAVE_SHAPE),
            ),
        },
        _set_ripple,
        prefix="ripple_",
        numbers=("ripple_per_N",),
        switches=("ripple_per_N",),
        memory=(("even_m", "f8"),),
        drives=_SPRING,
    ),
}
