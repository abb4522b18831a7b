"""Which residual is drawn over which variable for an effect, and how residuals and variables are labelled."""

from typing import Final, NamedTuple

Over = tuple[str, str]  # residual, variable
BREAKAWAY = "breakaway"
_FRICTION: Final = (("friction", "velocity_mps"),)
_LATE: Final = (("spring", "extension_rate_mps"), ("curvature", "acceleration_mps2"))
_SPRING: Final = (("spring", "extension_m"), ("curvature", "acceleration_mps2"))
_EXCITER: Final = (("exciter", "frequency_Hz"),)
# first what shows the effect best; the next where its channels are missing
SHOWN_BY: Final[dict[str, tuple[Over, ...]]] = {
    "static-friction-ageing": ((BREAKAWAY, "dwell_s"),),
    "static-level": ((BREAKAWAY, "dwell_s"),),
    "position-dependent-friction": (("friction", "position_m"), (BREAKAWAY, "position_m"), (BREAKAWAY, "time_s")),
    "normal-load-fluctuation": (("friction", "time_s"), (BREAKAWAY, "time_s")),
    "friction-drift": ((BREAKAWAY, "time_s"), ("friction", "time_s")),
    "direction-dependent-friction": ((BREAKAWAY, "direction"), *_FRICTION),
    "frictional-lag": _FRICTION,
    "viscous-friction": _FRICTION,
    "coulomb-level": _FRICTION,
    "stribeck-velocity": _FRICTION,
    "drive-damping": _LATE,
    "drive-stiffness": _SPRING,
    "drive-hardening": _SPRING,
    "drive-backlash": _SPRING,
    "drive-speed-ripple": (("drive", "drive_position_m"), (BREAKAWAY, "time_s")),
    "frame-compliance": _LATE,
    "base-compliance": _FRICTION,
    "piezo-roll-off": _EXCITER,
    "piezo-resonance": _EXCITER,
    "piezo-sag": (("exciter", "force_N"), ("exciter", "time_s")),
    "force-sensor-gain": _SPRING,
    "force-sensor-bias": _FRICTION,
    "force-sensor-drift": (("spring", "time_s"), (BREAKAWAY, "time_s")),
    "force-sensor-lag": _LATE,
    "force-sensor-delay": _LATE,
    "accelerometer-gain": (("motion", "acceleration_mps2"), ("curvature", "acceleration_mps2"), *_EXCITER),
}
SHOWN_TWICE: Final = {"piezo-sag"}  # its two formulas show over different variables
USUALLY_OVER: Final = {
    "spring": "extension_m",
    "curvature": "acceleration_mps2",
    "motion": "acceleration_mps2",
    "exciter": "frequency_Hz",
    "drive": "drive_position_m",
    "friction": "velocity_mps",
}


class Axis(NamedTuple):
    """A label with its unit, and the factor from SI to that unit."""

    label: str
    scale: float


X: Final = {
    "time_s": Axis("time in the run [s]", 1.0),
    "position_m": Axis("position of the mass [mm]", 1e3),
    "drive_position_m": Axis("position of the drive [mm]", 1e3),
    "velocity_mps": Axis("velocity of the mass [mm/s]", 1e3),
    "extension_m": Axis("extension of the spring [mm]", 1e3),
    "extension_rate_mps": Axis("rate of extension [mm/s]", 1e3),
    "acceleration_mps2": Axis("acceleration of the mass [m/s²]", 1.0),
    "dwell_s": Axis("time at rest before the breakaway [s]", 1.0),
    "direction": Axis("direction of the drive [-1, +1]", 1.0),
    "frequency_Hz": Axis("frequency of the vibration [kHz]", 1e-3),
    "force_N": Axis("drive force [N]", 1.0),
}
Y: Final = {
    BREAKAWAY: Axis("breakaway force - static friction [N]", 1.0),
    "spring": Axis("drive force - stiffness x extension [N]", 1.0),
    "curvature": Axis("-d²F/dt² - stiffness x accel. [kN/s²]", 1e-3),
    "motion": Axis("acceleration - d²x/dt² [m/s²]", 1.0),
    "exciter": Axis("delivered / commanded - 1 [%]", 100.0),
    "drive": Axis("drive position - even path [µm]", 1e6),
    "friction": Axis("friction force - friction law [N]", 1.0),
}
TITLES: Final = {
    BREAKAWAY: "Breakaway force against the retuned static friction, without vibration",
    "spring": "Does the spring pull as it is extended? Zero if it does",
    "curvature": "Does the force bend as the mass accelerates? Zero if it does",
    "motion": "Do accelerometer and displacement agree? Zero if they do",
    "exciter": "Does the base vibrate as commanded? Zero if it does",
    "drive": "Does the drive move evenly? Zero if it does",
    "friction": "Does sliding friction follow the law? Zero if it does",
}
