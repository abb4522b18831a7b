"""Effects on the level of friction: of speed, position, direction, time and load, and changes of its nominal numbers."""

import math
from typing import Any, Final

from bridge.kernel import kernel
from bridge.layouts import PlantParams
from plant.effects.row import TURN_RAD, WAVE_SHAPE, Effect, Formula, Parameter, one_form, ratio
from plant.effects.waves import TWO_PI, smooth_noise, wave, with_second


@kernel
def level(p: PlantParams, t_s: float, x: float, v_r: float, load_sin: float, load_cos: float) -> float:
    """Factor of the friction at the present position and time; sine and cosine give the phase of the load's wave."""
    result = 1.0 + p.drift_rate_per_s * t_s
    if p.drift_settling_s > 0.0:
        result += p.drift_ratio * (1.0 - math.exp(-(p.drift_before_s + t_s) / p.drift_settling_s))
    result = max(result, 0.0)
    if p.position_ratio != 0.0:
        result *= max(1.0 + p.position_ratio * _along_track(p, x), 0.0)
    if p.load_ratio != 0.0:
        if p.load_seed < 0.0:
            load = with_second(load_sin, load_cos, p.load_second_sin, p.load_second_cos)
        else:
            load = smooth_noise(2.0 * p.load_frequency_Hz * t_s, p.load_seed)
        result *= max(1.0 + p.load_ratio * load, 0.0)
    if p.roughness_ratio != 0.0:
        result *= max(1.0 + p.roughness_ratio * smooth_noise(x / p.roughness_length_m, p.roughness_seed), 0.0)
    # above 0: the slide never lifts off, and two negative factors must not make friction
    return max(result * (1.0 + (p.forward_ratio if v_r >= 0.0 else p.backward_ratio)), 0.01)


@kernel
def _along_track(p: PlantParams, x: float) -> float:
    """Change of the friction along the track, in units of `position_ratio`: a wave, two waves, bumps, or noise."""
    if p.position_seed >= 0.0:
        return smooth_noise(2.0 * x / p.position_wavelength_m, p.position_seed)
    angle_rad = TWO_PI * x / p.position_wavelength_m + p.position_phase_rad
    if p.position_width > 0.0:
        apart = angle_rad / TWO_PI - math.floor(angle_rad / TWO_PI + 0.5)
        along = math.exp(-0.5 * (apart / p.position_width) ** 2)
    else:
        along = wave(angle_rad, p.position_second_sin, p.position_second_cos)
    if p.position_other_share != 0.0:
        other_rad = TWO_PI * x / p.position_other_wavelength_m + p.position_other_phase_rad
        along += p.position_other_share * math.sin(other_rad)
    return along


def _set_viscous(p: Any, _form: str, value: dict[str, float]) -> None:
    p.h_v += value.get("damping_Ns_per_m", 0.0)
    p.quadratic_Ns2_per_m2 = value.get("damping_Ns2_per_m2", 0.0)


def _set_direction(p: Any, form: str, value: dict[str, float]) -> None:
    if form == "kinetic":
        p.kinetic_backward_ratio = value["ratio"]
    else:
        p.forward_ratio = 0.5 * value["ratio"] if form == "both" else 0.0
        p.backward_ratio = -0.5 * value["ratio"] if form == "both" else value["ratio"]


_PLACES = Parameter("wavelength_m", 1e-8, 1e3, 4e-3)
_TIMES = Parameter("frequency_Hz", 1e-3, 1e3, 3.0)
_SEED = Parameter("seed", 0, 1e6, 0)
_SWING = ratio(0.03, 0.0, 0.9)
FRICTION: Final = {
    "viscous-friction": Effect(
        "friction",
        {
            "linear": Formula("F_f grows by damping v_r", (Parameter("damping_Ns_per_m", 0.0, 1e5, 5.0),)),
            "quadratic": Formula("F_f grows by damping v_r |v_r|", (Parameter("damping_Ns2_per_m2", 0.0, 1e7, 200.0),)),
        },
        _set_viscous,
        numbers=("quadratic_Ns2_per_m2",),
        switches=("quadratic_Ns2_per_m2",),
    ),
    "position-dependent-friction": Effect(
        "friction",
        {
            "wave": Formula(
                "friction times 1 + ratio w(2 pi x / wavelength_m + phase)", (_SWING, _PLACES, *WAVE_SHAPE)
            ),
            "two-waves": Formula(
                "as wave without its harmonic, plus other_share sin(2 pi x / other_wavelength_m + other_phase)",
                (
                    *(_SWING, _PLACES, WAVE_SHAPE[0]),
                    *(Parameter("other_share", 0.0, 3.0, 0.5), Parameter("other_wavelength_m", 1e-8, 1e3, 1e-3)),
                    Parameter("other_phase_rad", -TURN_RAD, TURN_RAD, 0.0),
                ),
            ),
            "bumps": Formula(
                "friction times 1 + ratio exp(-(d / width)^2 / 2), d the distance in wavelengths from the nearest place "
                "where 2 pi x / wavelength_m + phase is a whole turn",
                (ratio(0.05, -0.9, 0.9), _PLACES, WAVE_SHAPE[0], Parameter("width", 0.01, 0.5, 0.1)),
            ),
            "random": Formula(
                "friction times 1 + ratio n(x), n smooth noise of unit rms, a new value every wavelength_m / 2",
                (_SWING, _PLACES, _SEED),
            ),
        },
        prefix="position_",
        off={"position_seed": -1.0},
    ),
    "direction-dependent-friction": Effect(
        "friction",
        {
            "backward": Formula("friction times 1 + ratio where v_r < 0", (ratio(0.1),)),
            "both": Formula(
                "friction times 1 + ratio / 2 where v_r > 0, 1 - ratio / 2 where v_r < 0", (ratio(0.1, -0.9, 0.9),)
            ),
            "kinetic": Formula("F_c alone times 1 + ratio where v_r < 0, F_s kept", (ratio(0.1, -0.9, 0.9),)),
        },
        _set_direction,
        numbers=("forward_ratio", "backward_ratio", "kinetic_backward_ratio"),
        switches=("forward_ratio", "backward_ratio", "kinetic_backward_ratio"),
    ),
    "normal-load-fluctuation": Effect(
        "friction",
        {
            "sine": Formula("friction times 1 + ratio w(2 pi frequency_Hz t + phase)", (_SWING, _TIMES, *WAVE_SHAPE)),
            "random": Formula(
                "friction times 1 + ratio n(t), n smooth noise of unit rms, a new value every 1 / (2 frequency_Hz)",
                (_SWING, _TIMES, _SEED),
            ),
        },
        prefix="load_",
        off={"load_seed": -1.0},
    ),
    "friction-drift": Effect(
        "friction",
        {
            "linear": Formula("friction times 1 + rate_per_s t", (Parameter("rate_per_s", -0.1, 0.1, 2e-3),)),
            "settling": Formula(
                "friction times 1 + ratio (1 - exp(-t / settling_s))",
                (ratio(0.05, -0.9, 0.9), Parameter("settling_s", 0.1, 1e4, 5.0)),
            ),
            "session": Formula(
                "as settling, continued from earlier runs: t + before_s in place of t",
                (
                    *(ratio(0.05, -0.9, 0.9), Parameter("settling_s", 0.1, 1e4, 15.0)),
                    Parameter("before_s", 0.0, 1e6, 0.0),
                ),
            ),
        },
        prefix="drift_",
    ),
    "coulomb-level": Effect("friction", one_form("F_c times 1 + ratio", ratio(0.1)), scales="F_c"),
    "static-level": Effect("friction", one_form("F_s times 1 + ratio", ratio(0.1)), scales="F_s", first=True),
    "stribeck-velocity": Effect("friction", one_form("v_s times 1 + ratio", ratio(0.5)), scales="v_s"),
}
