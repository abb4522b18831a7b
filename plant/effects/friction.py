"""The level of friction: over speed, position, direction, time and load, and its nominal numbers."""

import math
from typing import Any, Final

from bridge.kernel import kernel
from bridge.layouts import PlantParams
from plant.effects.row import TURN_RAD, WAVE_SHAPE, Effect, Formula, Parameter, one_form, ratio, wave_shape
from plant.effects.waves import TWO_PI, smooth_noise, wave, with_second


@kernel
def level(p: PlantParams, t_s: float, x: float, v_r: float, load_sin: float, load_cos: float) -> float:
    """Factor of the friction at the present position and time; sine and cosine give the phase of the load's wave."""
    result = 1.0 + p.drift_per_s * t_s
    if p.drift_settling_s > 0.0:
        result += p.drift_ratio * (1.0 - math.exp(-(p.drift_before_s + t_s) / p.drift_settling_s))
    result = max(result, 0.0)
    if p.position_ratio != 0.0:
        result *= max(1.0 + p.position_ratio * _along_track(p, x), 0.0)
    if p.load_ratio != 0.0:
        if p.load_seed < 0.0:
            load = with_second(load_sin, load_cos, p.load_sin_2, p.load_cos_2)
        else:
            load = smooth_noise(2.0 * p.load_frequency_Hz * t_s, p.load_seed)
        result *= max(1.0 + p.load_ratio * load, 0.0)
    if p.roughness_ratio != 0.0:
        result *= max(1.0 + p.roughness_ratio * smooth_noise(x / p.roughness_length_m, p.roughness_seed), 0.0)
    # above 0: the slide never lifts off, and two negative factors must not make friction
    return max(result * (1.0 + (p.forward_ratio if v_r >= 0.0 else p.backward_ratio)), 0.01)


@kernel
def _along_track(p: PlantParams, x: float) -> float:
    """The shape of the friction along the track: a wave, two waves, bumps, or noise."""
    if p.position_seed >= 0.0:
        return smooth_noise(2.0 * x / p.position_wavelength_m, p.position_seed)
    angle_rad = TWO_PI * x / p.position_wavelength_m + p.position_phase_rad
    if p.position_width > 0.0:
        apart = angle_rad / TWO_PI - math.floor(angle_rad / TWO_PI + 0.5)
        along = math.exp(-0.5 * (apart / p.position_width) ** 2)
    else:
        along = wave(angle_rad, p.position_sin_2, p.position_cos_2)
    if p.position_other_share != 0.0:
        other_rad = TWO_PI * x / p.position_other_wavelength_m + p.position_other_phase_rad
        along += p.position_other_share * math.sin(other_rad)
    return along


def _set_viscous(p: Any, _form: str, value: dict[str, float]) -> None:
    p.h_v += value.get("damping_Ns_per_m", 0.0)
    p.quadratic_Ns2_per_m2 = value.get("damping_Ns2_per_m2", 0.0)


def _set_position(p: Any, _form: str, value: dict[str, float]) -> None:
    p.position_ratio, p.position_wavelength_m = value["ratio"], value["wavelength_m"]
    p.position_phase_rad, p.position_sin_2, p.position_cos_2 = wave_shape(value)
    p.position_width = value.get("width", 0.0)
    p.position_other_share = value.get("other_share", 0.0)
    p.position_other_wavelength_m = value.get("other_wavelength_m", 0.0)
    p.position_other_phase_rad = value.get("other_phase_rad", 0.0)
    p.position_seed = value.get("seed", -1.0)


def _set_direction(p: Any, form: str, value: dict[str, float]) -> None:
    if form == "kinetic":
        p.kinetic_backward_ratio = value["ratio"]
    else:
        p.forward_ratio = 0.5 * value["ratio"] if form == "both" else 0.0
        p.backward_ratio = -0.5 * value["ratio"] if form == "both" else value["ratio"]


def _set_load(p: Any, _form: str, value: dict[str, float]) -> None:
    p.load_ratio, p.load_frequency_Hz = value["ratio"], value["frequency_Hz"]
    p.load_phase_rad, p.load_sin_2, p.load_cos_2 = wave_shape(value)
    p.load_seed = value.get("seed", -1.0)


def _set_drift(p: Any, _form: str, value: dict[str, float]) -> None:
    p.drift_per_s = value.get("rate_per_s", 0.0)
    p.drift_ratio, p.drift_settling_s = value.get("ratio", 0.0), value.get("settling_s", 0.0)
    p.drift_before_s = value.get("before_s", 0.0)


def _set_coulomb(p: Any, _form: str, value: dict[str, float]) -> None:
    p.F_c *= 1.0 + value["ratio"]


def _set_static(p: Any, _form: str, value: dict[str, float]) -> None:
    p.F_s *= 1.0 + value["ratio"]


def _set_stribeck(p: Any, _form: str, value: dict[str, float]) -> None:
    p.v_s *= 1.0 + value["ratio"]


_PLACES = Parameter("wavelength_m", 1e-5, 1.0, 4e-3)
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
                    *(Parameter("other_share", 0.0, 3.0, 0.5), Parameter("other_wavelength_m", 1e-5, 1.0, 1e-3)),
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
        _set_position,
        numbers=(
            *("position_ratio", "position_wavelength_m", "position_phase_rad", "position_sin_2", "position_cos_2"),
            *("position_other_share", "position_other_wavelength_m", "position_other_phase_rad", "position_seed"),
            "position_width",
        ),
        switches=("position_ratio",),
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
        _set_load,
        numbers=("load_ratio", "load_frequency_Hz", "load_phase_rad", "load_sin_2", "load_cos_2", "load_seed"),
        switches=("load_ratio",),
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
        _set_drift,
        numbers=("drift_per_s", "drift_ratio", "drift_settling_s", "drift_before_s"),
        switches=("drift_per_s", "drift_ratio"),
    ),
    "coulomb-level": Effect("friction", one_form("F_c times 1 + ratio", ratio(0.1)), _set_coulomb),
    "static-level": Effect("friction", one_form("F_s times 1 + ratio", ratio(0.1)), _set_static, first=True),
    "stribeck-velocity": Effect("friction", one_form("v_s times 1 + ratio", ratio(0.5)), _set_stribeck),
}
