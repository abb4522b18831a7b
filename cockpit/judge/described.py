"""The description of a run's sensors and axis, as far as its log has one: every number may be missing on a foreign rig."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from bridge.log.metadata import is_number
from bridge.wire.messages import CHANNELS

_ACCEL, _POSITION = ("accel_noise_mps2", "accel_resolution_mps2"), ("position_noise_m", "position_resolution_m")
_NOISE = dict(
    zip(CHANNELS, (("force_noise_N", "force_resolution_N"), _ACCEL, _ACCEL, _POSITION, _POSITION), strict=True)
)
_RANGE = {
    "drive_force_N": ("force_lowest_N", "force_range_N"),
    "mass_accel_mps2": (None, "accel_range_mps2"),
    "base_accel_mps2": (None, "accel_range_mps2"),
    "mass_position_m": ("position_lowest_m", "position_range_m"),
    "drive_position_m": ("position_lowest_m", "position_range_m"),
}
# Factor by which force over extension may be off the described stiffness, either way. Smaller: the bank's force sensor that shows
# 0.6 of the force is doubted; larger: pounds for newtons, 0.22, pass. More for effects that bend the relation, any less within
# backlash, and more for a rig that is not described, of whose stiffness the controller may be told a tenth.
_OFF, _OFF_BENT, _OFF_TOLD = 2.0, 4.0, 20.0
_BENT = {"drive-hardening", "frame-compliance", "drive-damping", "force-sensor-lag"}
_LOOSE = "drive-backlash"


class Described(NamedTuple):
    """Of a rig and its controller; NaN for a number that is not known."""

    noise: dict[str, float]  # rms of a sample, by channel
    step: dict[str, float]  # resolution
    ends: dict[str, tuple[float, float]]  # of the range
    stiffness_N_per_m: float  # of the drive, as the force sensor shows it
    of_rig: bool  # whether the stiffness is the rig's own; the controller may be told a wrong one
    off: float  # factor by which force over extension may be off that stiffness
    base_yields: bool  # whether friction moves the base
    drop_N: float  # F_s - F_c
    sliding_N: float  # F_c
    natural_s: float  # sqrt(m / k_d)
    uses_force: bool
    uses_slide: bool
    enabled_from_s: float
    v_ratio: float  # set point of v_a / v_d
    most_ratio: float  # to which the controller may raise it, after slips in spite of the vibration
    block_s: float

    @property
    def slip_m(self) -> float:
        """Way of a slip, 2 (F_s - F_c) / k_d; NaN where it is not known."""
        return 2.0 * self.drop_N / self.stiffness_N_per_m if self.of_rig else math.nan

    @property
    def slowest_fall_s(self) -> float:
        """How long a slip may last: 1.6 times that of the slide on its spring, and never less than 0.1 s."""
        return max(0.1, 3.0 * self.natural_s) if math.isfinite(self.natural_s) else 0.1


def described(plant: Mapping[str, Any] | None, controller: Mapping[str, Any] | None) -> Described:
    """From the configurations in a log; None for one that it does not hold."""
    rig = _table(plant or {}, "rig")
    sensors, effects, ours = _table(rig, "sensors"), _table(rig, "effects"), controller or {}
    k_d, mass_kg = _number(_table(rig, "drive"), "stiffness_N_per_m"), _number(_table(rig, "slide"), "mass_kg")
    of_rig = math.isfinite(k_d) and k_d > 0.0
    gain = _number(sensors, "force_gain", 1.0) * (1.0 + _number(_table(effects, "force-sensor-gain"), "ratio", 0.0))
    k_d *= gain * (1.0 + _number(_table(effects, "drive-stiffness"), "ratio", 0.0))
    contact = _table(rig, "contact")
    sliding_N = _number(contact, "coulomb_force_N") * (1.0 + _number(_table(effects, "coulomb-level"), "ratio", 0.0))
    static_N = _number(contact, "static_force_N") * (1.0 + _number(_table(effects, "static-level"), "ratio", 0.0))
    estimator = _table(ours, "estimator")
    return Described(
        noise={name: _number(sensors, of[0]) for name, of in _NOISE.items()},
        step={name: _number(sensors, of[1]) for name, of in _NOISE.items()},
        ends={name: _ends(sensors, *of) for name, of in _RANGE.items()},
        stiffness_N_per_m=k_d if of_rig else _number(ours, "drive_stiffness_N_per_m"),
        of_rig=of_rig,
        off=math.inf
        if _LOOSE in effects
        else _OFF_TOLD
        if not of_rig
        else _OFF_BENT
        if _BENT & effects.keys()
        else _OFF,
        base_yields="base-compliance" in effects,
        drop_N=(static_N - sliding_N) * gain,
        sliding_N=sliding_N * gain,
        natural_s=math.sqrt(mass_kg / k_d) if of_rig and mass_kg > 0.0 else math.nan,
        uses_force=estimator.get("use_force") is not False,
        uses_slide=estimator.get("use_slide_position") is not False,
        enabled_from_s=_number(_table(ours, "policy"), "enabled_from_s", 0.0),
        v_ratio=_number(_table(ours, "limits"), "v_ratio"),
        most_ratio=_number(_table(ours, "policy"), "most_ratio"),
        block_s=_number(ours, "block_s"),
    )


def _table(of: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    found = of.get(name)
    return found if isinstance(found, Mapping) else {}


def _number(of: Mapping[str, Any], name: str, otherwise: float = math.nan) -> float:
    found: Any = of.get(name)
    return float(found) if is_number(found) else otherwise


def _ends(sensors: Mapping[str, Any], lowest: str | None, highest: str) -> tuple[float, float]:
    high = _number(sensors, highest, math.inf)
    return (_number(sensors, lowest, -math.inf) if lowest else -high), high
