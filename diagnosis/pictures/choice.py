"""The pictures of a diagnosis: measured and predicted cycles, and residuals over the variable that explains them."""

from typing import Final, NamedTuple

import numpy as np

from bridge.arrays import Floats
from diagnosis.evidence.manifest import RigTable
from diagnosis.gap.prepare import Prepared
from diagnosis.gap.problem import Point, Problem
from diagnosis.hypotheses.catalogue import BREAKAWAY, CATALOGUE, Over
from diagnosis.pictures.cycles import Style, Version, cycle_pictures
from diagnosis.pictures.residuals import residual_of
from diagnosis.result import Curve, Picture

_CLOUD = 900  # most points of a measured cloud
_BINS = 50  # bins of a mean line
_BINS_OF_A_TRACK = 160  # bins of a mean line over a position: on a track of 15 mm a ripple of 1 mm still shows
_FEWEST = 3  # fewest points of a bin
# drawn with the named effects, the first whose channels exist; `report` draws the worst relation over time
_USUAL: Final[tuple[Over, ...]] = (
    ("friction", "velocity_mps"), (BREAKAWAY, "time_s"), ("spring", "extension_m"), ("motion", "acceleration_mps2"),
    ("exciter", "frequency_Hz"), ("curvature", "acceleration_mps2"),
)  # fmt: skip


def pictures(
    problem: Problem, nominal: Point, baseline: Point, named: Point | None, effects: tuple[str, ...]
) -> tuple[Picture, ...]:
    """At most ten pictures: the segment of each run that differs most, slips in close-up where they differ, residuals.

    Args:
        problem: the runs to show.
        nominal: the rig as described.
        baseline: the rig without effects, refitted within its tolerances.
        named: the model with the named effects; None when no effect was named.
        effects: the named effects.

    """

    def of_model(label: str, style: Style, point: Point) -> dict[str, Version]:
        return {run.file: Version(label, style, problem.signals(run, point)) for run in problem.runs}

    models = [of_model("rig as described", "nominal", nominal), of_model("baseline", "retuned", baseline)]
    if named is not None:
        models.append(of_model("with " + " and ".join(effects), "effect", named))
    rig = problem.rig.model_copy(
        update={name: baseline.values[name] for name in problem.rig.tolerance if name in baseline.values}
    )
    residuals = residual_pictures(rig, problem.runs, models[1:], effects)
    return (*cycle_pictures(problem, models), *residuals)


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
SHOWN: Final = {  # title and axis of each residual
    BREAKAWAY: (
        "Breakaway force against the baseline's static friction, without vibration",
        Axis("breakaway force - static friction [N]", 1.0),
    ),
    "spring": (
        "Spring force less stiffness times extension: zero if the spring law holds",
        Axis("drive force - stiffness x extension [N]", 1.0),
    ),
    "curvature": (
        "Does the force bend as the mass accelerates? Zero if it does",
        Axis("-d²F/dt² - stiffness x accel. [kN/s²]", 1e-3),
    ),
    "motion": (
        "Do accelerometer and displacement agree? Zero if they do",
        Axis("acceleration - d²x/dt² [m/s²]", 1.0),
    ),
    "exciter": ("Does the base vibrate as commanded? Zero if it does", Axis("delivered / commanded - 1 [%]", 100.0)),
    "drive": ("Does the drive move evenly? Zero if it does", Axis("drive position - even path [µm]", 1e6)),
    "friction": (
        "Does sliding friction follow the law? Zero if it does",
        Axis("friction force - friction law [N]", 1.0),
    ),
}


def residual_pictures(
    rig: RigTable, runs: list[Prepared], models: list[dict[str, Version]], effects: tuple[str, ...]
) -> list[Picture]:
    """One or two pictures for each named effect, and one of a usual residual; two of usual residuals without effects.

    Args:
        rig: rig with the numbers of the baseline.
        runs: the measured runs.
        models: predictions to compare with, for every run by its file.
        effects: the named effects.

    """
    wanted: list[Over] = []
    for effect in effects:
        row = CATALOGUE[effect]
        possible = [over for over in row.shown_by if len(_points(rig, runs, over)[0])]
        wanted += [over for over in possible[: 2 if row.shown_twice else 1] if over not in wanted]
    others = [
        over for over in _USUAL if over[0] not in {name for name, _ in wanted} and len(_points(rig, runs, over)[0])
    ]
    wanted += others[: max(max(2, len(effects) + 1) - len(wanted), 0)]
    return [_picture(rig, runs, models, over) for over in wanted]


def _points(rig: RigTable, runs: list[Prepared], over: Over) -> tuple[Floats, Floats]:
    """The variable and the residual of all runs, [points] each."""
    name, variable = over
    x: list[Floats] = [np.zeros(0)]
    y: list[Floats] = [np.zeros(0)]
    for run in runs:
        residual = residual_of(name, rig, run)
        if residual is not None and variable in residual.over:
            values = residual.values
            if variable == "force_N":
                values = _without_levels(values, residual.over["frequency_Hz"])
            x.append(residual.over[variable])
            y.append(values)
    return np.concatenate(x), np.concatenate(y)


def _without_levels(values: Floats, frequency_Hz: Floats) -> Floats:
    """`values` less their mean at each frequency, which would hide a dependence on the force."""
    _, which, counts = np.unique(frequency_Hz, return_inverse=True, return_counts=True)
    return values - (np.bincount(which, values) / counts)[which]


def _picture(rig: RigTable, runs: list[Prepared], models: list[dict[str, Version]], over: Over) -> Picture:
    name, variable = over
    x, (title, y) = X[variable], SHOWN[name]
    if variable == "time_s" or name == "spring":
        # time and the zero of an extension differ from run to run, so only the run with the largest residual is drawn
        runs = [max(runs, key=lambda run: float(np.abs(_points(rig, [run], over)[1]).max(initial=0.0)))]
        title += f" ({runs[0].file.rsplit('.', 1)[0]})"
    if variable == "force_N":
        title += " (less its mean at each frequency)"
    seen_x, seen_y = _points(rig, runs, over)
    cloud = np.linspace(0, len(seen_x) - 1, min(len(seen_x), _CLOUD)).astype(np.int64)
    curves = [Curve("measured", seen_x[cloud] * x.scale, seen_y[cloud] * y.scale, "points")]
    if variable != "dwell_s":
        curves.append(_line("measured, mean", "measured", seen_x, seen_y, over))
    for model in models:
        label, style, _ = model[runs[0].file]
        predicted = [run._replace(signals=model[run.file].signals) for run in runs]
        curves.append(_line(label, style, *_points(rig, predicted, over), over))
    return Picture("residual", title, x.label, y.label, tuple(curves))


def _line(label: str, style: Style, x: Floats, y: Floats, over: Over) -> Curve:
    """The mean of y in bins of x, interrupted where several bins are empty."""
    name, variable = over
    if len(x) < 2:
        return Curve(label, np.zeros(0), np.zeros(0), style)
    low, high = np.quantile(x, (0.002, 0.998))
    bins = _BINS_OF_A_TRACK if variable.endswith("position_m") else _BINS
    place = np.clip(((x - low) / max(high - low, 1e-12) * bins).astype(np.int64), 0, bins - 1)
    count = np.bincount(place, minlength=bins)
    filled = np.flatnonzero(count >= (_FEWEST if name != BREAKAWAY else 1))
    mean_x, mean_y = (np.bincount(place, values, bins)[filled] / count[filled] for values in (x, y))
    if variable not in {"dwell_s", "frequency_Hz"}:
        holes = np.flatnonzero(np.diff(filled) > bins // 8) + 1
        mean_x, mean_y = np.insert(mean_x, holes, np.nan), np.insert(mean_y, holes, np.nan)
    return Curve(label, mean_x * X[variable].scale, mean_y * SHOWN[name][1].scale, style)
