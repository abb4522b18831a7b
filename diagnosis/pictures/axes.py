"""Labels of residuals and variables, and the default variable over which each residual is drawn."""

from typing import Final, NamedTuple

from diagnosis.hypotheses.catalogue_row import BREAKAWAY

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
    BREAKAWAY: "Breakaway force against the baseline's static friction, without vibration",
    "spring": "Spring force less stiffness times extension: zero if the spring law holds",
    "curvature": "Does the force bend as the mass accelerates? Zero if it does",
    "motion": "Do accelerometer and displacement agree? Zero if they do",
    "exciter": "Does the base vibrate as commanded? Zero if it does",
    "drive": "Does the drive move evenly? Zero if it does",
    "friction": "Does sliding friction follow the law? Zero if it does",
}
