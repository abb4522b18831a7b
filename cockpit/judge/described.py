"""Description of a run's sensors and axis in its log. On a foreign rig any number may be missing."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from bridge.log.check.channel import ChannelLimits, channels_of
from bridge.log.metadata import is_number

# Largest difference of force and spring, as a share of the larger. Smaller: a described stiffness that is 30 % wrong is doubted.
# Larger: a force sensor of half or twice the scale, 0.5, passes. With effects that bend the relation, and for a rig without a
# description, whose configured stiffness may be 10 times wrong, only the sign counts.
_APART, _APART_SIGN = 0.4, 1.05
_BENT = {"drive-hardening", "frame-compliance", "drive-damping", "force-sensor-lag", "drive-backlash"}


class Described(NamedTuple):
    """Description of a rig and its controller; NaN for unknown numbers."""

    channels: dict[str, ChannelLimits]
    stiffness_N_per_m: (
        float  # of the drive, in readings of the force sensor; without a rig, from the controller's configuration
    )
    apart: float  # allowed difference of force and spring, as a share
    drop_N: float  # F_s - F_c
    slip_m: float  # length of a slip, 2 (F_s - F_c) / k_d
    mass_kg: float  # of the slide
    contact_per_s2: float  # stiffness of the contact over the mass
    uses_force: bool  # the verdict depends on the force: the controller uses it, or the rig is described
    uses_slide: bool
    accel_bandwidth_Hz: float  # for which the controller corrects v_a; infinite if unknown


def described(plant: Mapping[str, Any] | None, controller: Mapping[str, Any] | None) -> Described:
    """Description from the configurations in a log; None for a missing configuration."""
    tables = {"rig": (plant or {}).get("rig"), "controller": controller}

    def number(path: str, otherwise: float = math.nan) -> float:
        value = _at(tables, path)
        return float(value) if is_number(value) else otherwise

    def grown(effect: str) -> float:
        return 1.0 + number(f"rig.effects.{effect}.ratio", 0.0)

    effects = _at(tables, "rig.effects")
    names = effects.keys() if isinstance(effects, Mapping) else set[str]()
    gain = number("rig.sensors.force_gain", 1.0) * grown("force-sensor-gain")
    k_d = number("rig.drive.stiffness_N_per_m") * gain * grown("drive-stiffness")
    static_N = number("rig.contact.static_force_N") * grown("static-level")
    sliding_N = number("rig.contact.coulomb_force_N") * grown("coulomb-level")
    mass_kg = number("rig.slide.mass_kg") or math.nan
    return Described(
        channels=channels_of(plant),
        stiffness_N_per_m=k_d if k_d > 0.0 else number("controller.drive_stiffness_N_per_m"),
        apart=_APART if k_d > 0.0 and not _BENT & names else _APART_SIGN,
        drop_N=(static_N - sliding_N) * gain,
        slip_m=2.0 * (static_N - sliding_N) * gain / k_d if k_d > 0.0 else math.nan,
        mass_kg=mass_kg,
        contact_per_s2=number("rig.contact.stiffness_N_per_m") / mass_kg,
        uses_force=k_d > 0.0 or _at(tables, "controller.estimator.use_force") is not False,
        uses_slide=k_d > 0.0 or _at(tables, "controller.estimator.use_slide_position") is not False,
        accel_bandwidth_Hz=number("controller.amplitude.accel_bandwidth_Hz", math.inf),
    )


def _at(table: Any, path: str) -> Any:
    for name in path.split("."):
        table = table.get(name) if isinstance(table, Mapping) else None
    return table
