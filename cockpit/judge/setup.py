"""Numbers of the configurations in the log that the judge needs. On a foreign rig any number may be missing."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from bridge.log.check.channel import ChannelLimits, channels_of
from bridge.log.metadata import Metadata, configuration_of, is_number, number_of, source_of_import, texts_of, value_at

SETTLING_S = 1.0  # time that is not judged after the controller was enabled, stopped or absent
# Largest difference between measured force and stiffness times extension, as a share of the larger. Smaller: a described
# stiffness that is 30 % wrong is doubted. Larger: a force sensor of half or twice the scale, 0.5, passes. With effects that bend
# the relation, and for a rig without a description, whose configured stiffness may be 10 times wrong, only the sign counts.
_APART, _APART_SIGN = 0.4, 1.05
_BENT = {"drive-hardening", "frame-compliance", "drive-damping", "force-sensor-lag", "drive-backlash"}


class Setup(NamedTuple):
    """Setup of one run."""

    imported: str  # source file of an imported log; empty for a run
    block_s: float
    enabled_from_s: float  # time at which the controller is enabled; infinite for an imported log, which has none
    slowest_fall_s: float  # longest duration of a fall of the force that counts as a slip
    absent: list[str]  # channels missing in the source file of an imported log; they are zeros in the log
    known_gain: bool  # the configuration declares the exciter's gain as verified
    v_ratio: float  # configured set point of v_a / v_d; infinite if unknown
    duration_s: float  # planned length of the run, by the plant's configuration; 0: unlimited or unknown
    stiffness_N_per_m: float = 0.0  # k_d of the controller's configuration; 0: not given

    @property
    def settled_from_s(self) -> float:
        """Start of the judged time."""
        return settled_from_s(self.enabled_from_s)


class Described(NamedTuple):
    """Description of a rig and its controller; NaN for unknown numbers."""

    channels: dict[str, ChannelLimits]
    stiffness_N_per_m: float  # of the drive spring, by the force sensor; without a described rig the controller's value
    apart: float  # allowed difference between measured force and stiffness times extension, as a share of the larger
    fall_N: float  # fall of the force in a slip, 2 (F_s - F_c)
    slip_m: float  # length of a slip, 2 (F_s - F_c) / k_d
    mass_kg: float  # mass of the slide
    contact_per_s2: float  # stiffness of the sliding contact over the mass of the slide
    uses_force: bool  # the verdict depends on the force: the controller uses it, or the rig is described
    uses_slide: bool
    accel_bandwidth_Hz: float  # bandwidth for which the controller corrects v_a; infinite if unknown


def settled_from_s(enabled_from_s: float) -> float:
    """Start of the judged time of a controller enabled at `enabled_from_s`."""
    return enabled_from_s + SETTLING_S if enabled_from_s > 0 else 0.0


def is_known(headers: Metadata) -> bool:
    """True if the tables read so far suffice to judge the log."""
    return "import" in headers or "controller" in headers


def setup_of(headers: Metadata, path: Path, period_ns: float) -> Setup:
    """Setup of a log; `period_ns`: block period, used for an imported log, which has no controller. Raises Fault BAD_LOG."""
    absent = absent_channels(headers, path)
    plant = plant_of(headers, path)
    mass_kg, stiffness = _number(plant, "rig.slide.mass_kg"), _number(plant, "rig.drive.stiffness_N_per_m")
    # 1.6 times the time in which a slide on its spring slips from 10 to 90 % of the fall
    fall_s = max(0.1, 3.0 * math.sqrt(mass_kg / stiffness)) if mass_kg > 0.0 and stiffness > 0.0 else 0.1
    if source := source_of_import(headers, path):
        return Setup(source, period_ns * 1e-9, math.inf, fall_s, absent, True, math.inf, 0.0)
    controller = configuration_of(headers, "controller", path)
    return Setup(
        imported="",
        block_s=number_of(controller, "block_s", path),
        enabled_from_s=number_of(controller, "policy.enabled_from_s", path),
        slowest_fall_s=fall_s,
        absent=absent,
        known_gain=bool(value_at(controller, "amplitude.known_gain")),
        v_ratio=_number(controller, "limits.v_ratio", math.inf),
        duration_s=_number(plant, "duration_s", 0.0),
        stiffness_N_per_m=_number(controller, "drive_stiffness_N_per_m", 0.0),
    )


def plant_of(headers: Metadata, path: Path) -> Any:
    """Configuration of the plant in a log; empty for a log without one. Raises Fault BAD_LOG."""
    return configuration_of(headers, "plant", path) if "plant" in headers else {}


def absent_channels(headers: Metadata, path: Path) -> list[str]:
    """Channels missing in the source file of an imported log; they are zeros in the log. Raises Fault BAD_LOG."""
    return texts_of(headers, "import", "missing", path)


def described(plant: Mapping[str, Any], controller: Mapping[str, Any]) -> Described:
    """Description from the configurations in a log; an empty mapping for a missing configuration."""

    def rig(path: str, otherwise: float = math.nan) -> float:
        return _number(plant, f"rig.{path}", otherwise)

    def grown(effect: str) -> float:
        return 1.0 + rig(f"effects.{effect}.ratio", 0.0)

    effects = value_at(plant, "rig.effects")
    names = effects.keys() if isinstance(effects, Mapping) else set[str]()
    gain = rig("sensors.force_gain", 1.0) * grown("force-sensor-gain")
    k_d = rig("drive.stiffness_N_per_m") * gain * grown("drive-stiffness")
    static_N = rig("contact.static_force_N") * grown("static-level")
    fall_N = 2.0 * (static_N - rig("contact.coulomb_force_N") * grown("coulomb-level")) * gain
    mass_kg = rig("slide.mass_kg") or math.nan
    return Described(
        channels=channels_of(plant),
        stiffness_N_per_m=k_d if k_d > 0.0 else _number(controller, "drive_stiffness_N_per_m"),
        apart=_APART if k_d > 0.0 and not _BENT & names else _APART_SIGN,
        fall_N=fall_N,
        slip_m=fall_N / k_d if k_d > 0.0 else math.nan,
        mass_kg=mass_kg,
        contact_per_s2=rig("contact.stiffness_N_per_m") / mass_kg,
        uses_force=k_d > 0.0 or value_at(controller, "estimator.use_force") is not False,
        uses_slide=k_d > 0.0 or value_at(controller, "estimator.use_slide_position") is not False,
        accel_bandwidth_Hz=_number(controller, "amplitude.accel_bandwidth_Hz", math.inf),
    )


def _number(table: Any, path: str, otherwise: float = math.nan) -> float:
    value = value_at(table, path)
    return float(value) if is_number(value) else otherwise
