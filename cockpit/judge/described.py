"""The description of a run's sensors and axis, as far as its log has one: every number may be missing on a foreign rig."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from bridge.log.check.channel import Channel, channels_of
from bridge.log.metadata import is_number

# Factor by which force over extension may be off the described stiffness, either way. Smaller: the bank's force sensor that shows
# 0.6 of the force is doubted; larger: pounds for newtons, 0.22, pass. Twice that for effects that bend the relation; with
# backlash, and for a rig that is not described, of whose stiffness the controller may have a tenth, the sign alone counts.
_OFF, _OFF_BENT = 2.0, 4.0
_BENT = {"drive-hardening", "frame-compliance", "drive-damping", "force-sensor-lag"}
_LOOSE = "drive-backlash"


class Described(NamedTuple):
    """Of a rig and its controller; NaN for a number that is not known."""

    channels: dict[str, Channel]
    stiffness_N_per_m: float  # of the drive, as the force sensor shows it
    of_rig: bool  # whether the stiffness is the rig's own; the controller may be told a wrong one
    off: float  # factor by which force over extension may be off that stiffness
    drop_N: float  # F_s - F_c
    uses_force: bool
    uses_slide: bool
    enabled_from_s: float
    v_ratio: float  # set point of v_a / v_d
    most_ratio: float  # to which the controller may raise it, after slips in spite of the vibration

    @property
    def slip_m(self) -> float:
        """Way of a slip, 2 (F_s - F_c) / k_d; NaN where it is not known."""
        return 2.0 * self.drop_N / self.stiffness_N_per_m if self.of_rig else math.nan


def described(plant: Mapping[str, Any] | None, controller: Mapping[str, Any] | None) -> Described:
    """From the configurations in a log; None for one that it does not hold."""
    rig = _table(plant or {}, "rig")
    sensors, effects, ours = _table(rig, "sensors"), _table(rig, "effects"), controller or {}
    k_d = _number(_table(rig, "drive"), "stiffness_N_per_m")
    of_rig = math.isfinite(k_d) and k_d > 0.0
    gain = _number(sensors, "force_gain", 1.0) * (1.0 + _number(_table(effects, "force-sensor-gain"), "ratio", 0.0))
    k_d *= gain * (1.0 + _number(_table(effects, "drive-stiffness"), "ratio", 0.0))
    contact = _table(rig, "contact")
    sliding_N = _number(contact, "coulomb_force_N") * (1.0 + _number(_table(effects, "coulomb-level"), "ratio", 0.0))
    static_N = _number(contact, "static_force_N") * (1.0 + _number(_table(effects, "static-level"), "ratio", 0.0))
    estimator = _table(ours, "estimator")
    return Described(
        channels=channels_of(plant),
        stiffness_N_per_m=k_d if of_rig else _number(ours, "drive_stiffness_N_per_m"),
        of_rig=of_rig,
        off=math.inf if _LOOSE in effects or not of_rig else _OFF_BENT if _BENT & effects.keys() else _OFF,
        drop_N=(static_N - sliding_N) * gain,
        uses_force=estimator.get("use_force") is not False,
        uses_slide=estimator.get("use_slide_position") is not False,
        enabled_from_s=_number(_table(ours, "policy"), "enabled_from_s", 0.0),
        v_ratio=_number(_table(ours, "limits"), "v_ratio"),
        most_ratio=_number(_table(ours, "policy"), "most_ratio"),
    )


def _table(of: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    found = of.get(name)
    return found if isinstance(found, Mapping) else {}


def _number(of: Mapping[str, Any], name: str, otherwise: float = math.nan) -> float:
    found: Any = of.get(name)
    return float(found) if is_number(found) else otherwise
