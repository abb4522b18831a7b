"""Residuals drawn over the variable that explains them: which one, follows from the effect that was named."""

from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from diagnosis.breakaways import breakaways
from diagnosis.cycle_pictures import Style
from diagnosis.features import Scales, Signals
from diagnosis.manifest import RigTable
from diagnosis.parity import parity_residuals
from diagnosis.problem import Prepared
from diagnosis.result import Curve, Picture

Floats = npt.NDArray[np.float64]
Over = tuple[str, str]  # residual, variable
_CLOUD = 900
_BINS = 120
_FEWEST = 3  # points of a bin
_BREAKAWAY = "breakaway"
_FRICTION: Final = (("friction", "velocity_mps"),)
_LATE: Final = (("spring", "extension_rate_mps"), ("curvature", "acceleration_mps2"))
_SPRING: Final = (("spring", "extension_m"), ("curvature", "acceleration_mps2"))
_EXCITER: Final = (("exciter", "frequency_Hz"),)
# first what shows the effect best; the next where its channels are missing
_SHOWN_BY: Final[dict[str, tuple[Over, ...]]] = {
    "static-friction-ageing": ((_BREAKAWAY, "dwell_s"),),
    "static-level": ((_BREAKAWAY, "dwell_s"),),
    "position-dependent-friction": ((_BREAKAWAY, "position_m"), ("friction", "position_m"), (_BREAKAWAY, "time_s")),
    "normal-load-fluctuation": ((_BREAKAWAY, "time_s"), ("friction", "time_s")),
    "friction-drift": ((_BREAKAWAY, "time_s"), ("friction", "time_s")),
    "direction-dependent-friction": ((_BREAKAWAY, "direction"), *_FRICTION),
    "frictional-lag": _FRICTION,
    "viscous-friction": _FRICTION,
    "coulomb-level": _FRICTION,
    "stribeck-velocity": _FRICTION,
    "drive-damping": _LATE,
    "drive-stiffness": _SPRING,
    "drive-hardening": _SPRING,
    "drive-backlash": _SPRING,
    "drive-speed-ripple": (("drive", "drive_position_m"), (_BREAKAWAY, "time_s")),
    "frame-compliance": _LATE,
    "base-compliance": _FRICTION,
    "piezo-roll-off": _EXCITER,
    "piezo-resonance": _EXCITER,
    "piezo-sag": (("exciter", "force_N"), ("exciter", "time_s")),
    "force-sensor-gain": _SPRING,
    "force-sensor-bias": _FRICTION,
    "force-sensor-drift": (("spring", "time_s"), (_BREAKAWAY, "time_s")),
    "force-sensor-lag": _LATE,
    "force-sensor-delay": _LATE,
    "accelerometer-gain": (("motion", "acceleration_mps2"), ("curvature", "acceleration_mps2"), *_EXCITER),
}
_USUALLY_OVER: Final = {
    "spring": "extension_m",
    "curvature": "acceleration_mps2",
    "motion": "acceleration_mps2",
    "exciter": "frequency_Hz",
    "drive": "drive_position_m",
    "friction": "velocity_mps",
}


class _Axis(NamedTuple):
    label: str
    scale: float


_X: Final = {
    "time_s": _Axis("time in the run [s]", 1.0),
    "position_m": _Axis("position of the mass [mm]", 1e3),
    "drive_position_m": _Axis("position of the drive [mm]", 1e3),
    "velocity_mps": _Axis("velocity of the mass [mm/s]", 1e3),
    "extension_m": _Axis("extension of the spring [mm]", 1e3),
    "extension_rate_mps": _Axis("rate of extension [mm/s]", 1e3),
    "acceleration_mps2": _Axis("acceleration of the mass [m/s²]", 1.0),
    "dwell_s": _Axis("time at rest before the breakaway [s]", 1.0),
    "direction": _Axis("direction of the drive [-1, +1]", 1.0),
    "frequency_Hz": _Axis("frequency of the vibration [kHz]", 1e-3),
    "force_N": _Axis("drive force [N]", 1.0),
}
_Y: Final = {
    _BREAKAWAY: _Axis("breakaway force - static friction [N]", 1.0),
    "spring": _Axis("drive force - stiffness x extension [N]", 1.0),
    "curvature": _Axis("-d²F/dt² - stiffness x accel. [kN/s²]", 1e-3),
    "motion": _Axis("acceleration - d²x/dt² [m/s²]", 1.0),
    "exciter": _Axis("delivered / commanded - 1 [%]", 100.0),
    "drive": _Axis("drive position - even path [µm]", 1e6),
    "friction": _Axis("friction force - friction law [N]", 1.0),
}
_TITLES: Final = {
    _BREAKAWAY: "Breakaway force against the retuned static friction, without vibration",
    "spring": "Does the spring pull as it is extended? Zero if it does",
    "curvature": "Does the force bend as the mass accelerates? Zero if it does",
    "motion": "Do accelerometer and displacement agree? Zero if they do",
    "exciter": "Does the base vibrate as commanded? Zero if it does",
    "drive": "Does the drive move evenly? Zero if it does",
    "friction": "Does sliding friction follow the law? Zero if it does",
}


class Model(NamedTuple):
    """What the measured residual is compared with: predicted signals by file."""

    label: str
    style: Style
    signals: dict[str, Signals]


class _Series(NamedTuple):
    x: Floats
    y: Floats
    rms: float  # in units of the noise


def residual_pictures(
    rig: RigTable, runs: list[Prepared], scales: Scales, models: list[Model], effects: tuple[str, ...]
) -> list[Picture]:
    """One or two pictures for every named effect; without one, the two residuals that stand out most.

    Args:
        rig: the retuned one.
        models: what to compare with, of every run.

    """
    wanted: list[Over] = []
    for effect in effects:
        possible = [over for over in _SHOWN_BY[effect] if any(len(one.x) for one in _all(rig, runs, scales, over))]
        wanted += [over for over in possible[:1] if over not in wanted]
    for over in _standing_out(rig, runs):
        if len(wanted) < max(2, len(effects) + 1) and over[0] not in {residual for residual, _ in wanted}:
            wanted.append(over)
    return [_picture(rig, runs, scales, models, over) for over in wanted]


def _standing_out(rig: RigTable, runs: list[Prepared]) -> list[Over]:
    largest: dict[str, float] = {}
    for run in runs:
        for residual in parity_residuals(rig, run):
            largest[residual.name] = max(largest.get(residual.name, 0.0), residual.rms)
    return [(name, _USUALLY_OVER[name]) for name in sorted(largest, key=lambda name: -largest[name])]


def _all(rig: RigTable, runs: list[Prepared], scales: Scales, over: Over) -> list[_Series]:
    return [_series(rig, run, scales, over) for run in runs]


def _series(rig: RigTable, run: Prepared, scales: Scales, over: Over) -> _Series:
    name, variable = over
    nothing = _Series(np.zeros(0), np.zeros(0), 0.0)
    if name == _BREAKAWAY:
        above_N, columns = breakaways(rig, run, scales) if rig.drive == "spring" else (np.zeros(0), {})
        if len(above_N) == 0 or variable not in columns:
            return nothing
        return _Series(columns[variable], above_N, float(np.abs(above_N).max()))
    for residual in parity_residuals(rig, run):
        if residual.name == name and variable in residual.over:
            return _Series(residual.over[variable], residual.values, residual.rms)
    return nothing


def _picture(rig: RigTable, runs: list[Prepared], scales: Scales, models: list[Model], over: Over) -> Picture:
    name, variable = over
    x, y = _X[variable], _Y[name]
    title = _TITLES[name]
    measured = _all(rig, runs, scales, over)
    if variable == "time_s":
        # every run starts at zero: of several only the most telling one
        worst = max(range(len(runs)), key=lambda i: measured[i].rms)
        runs, measured = [runs[worst]], [measured[worst]]
        title += f" ({runs[0].file.rsplit('.', 1)[0]})"
    few = name == _BREAKAWAY
    seen_x, seen_y = _joined(measured)
    cloud = np.linspace(0, len(seen_x) - 1, min(len(seen_x), _CLOUD)).astype(np.int64)
    curves = [Curve("measured", seen_x[cloud] * x.scale, seen_y[cloud] * y.scale, "points")]
    if not few:
        curves.append(_line("measured, mean", "measured", seen_x, seen_y, over))
    for model in models:
        predicted = [run._replace(signals=model.signals[run.file]) for run in runs]
        curves.append(_line(model.label, model.style, *_joined(_all(rig, predicted, scales, over)), over))
    return Picture("residual", title, x.label, y.label, tuple(curves))


def _joined(series: list[_Series]) -> tuple[Floats, Floats]:
    return np.concatenate([one.x for one in series]), np.concatenate([one.y for one in series])


def _line(label: str, style: Style, x: Floats, y: Floats, over: Over) -> Curve:
    """The mean in bins of x, a hole where several bins are empty."""
    name, variable = over
    if len(x) < 2:
        return Curve(label, np.zeros(0), np.zeros(0), style)
    low, high = np.quantile(x, (0.002, 0.998))
    bins = _BINS if name != _BREAKAWAY else 40
    place = np.clip(((x - low) / max(high - low, 1e-12) * bins).astype(np.int64), 0, bins - 1)
    count = np.bincount(place, minlength=bins)
    filled = np.flatnonzero(count >= (_FEWEST if name != _BREAKAWAY else 1))
    mean_x = np.bincount(place, x, bins)[filled] / count[filled]
    mean_y = np.bincount(place, y, bins)[filled] / count[filled]
    if variable in {"position_m", "drive_position_m", "time_s"}:
        holes = np.flatnonzero(np.diff(filled) > bins // 8) + 1
        mean_x, mean_y = np.insert(mean_x, holes, np.nan), np.insert(mean_y, holes, np.nan)
    return Curve(label, mean_x * _X[variable].scale, mean_y * _Y[name].scale, style)
