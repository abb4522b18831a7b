"""Residuals drawn over the variable that explains them; the named effect selects the residual and the variable."""

from typing import NamedTuple

import numpy as np

from bridge.arrays import Floats
from diagnosis.evidence.manifest import RigTable
from diagnosis.features.feature import Scales, Signals
from diagnosis.gap.prepare import Prepared
from diagnosis.hypotheses.catalogue import CATALOGUE
from diagnosis.hypotheses.catalogue_row import BREAKAWAY, Over
from diagnosis.pictures.axes import TITLES, USUALLY_OVER, X, Y
from diagnosis.pictures.breakaways import breakaways
from diagnosis.pictures.channel_relations import parity_residuals
from diagnosis.pictures.cycles import Style
from diagnosis.result import Curve, Picture

_ROUNDING = 1e-3  # largest rms of rounding, in units of the noise: the logged drive position is the commanded one
_CLOUD = 900  # most points of a measured cloud
_BINS = 50  # bins of a mean line
_BINS_OF_A_TRACK = 160  # bins of a mean line over a position: on a track of 15 mm a ripple of 1 mm still shows
_FEWEST = 3  # fewest points of a bin


class Overlay(NamedTuple):
    """A model that is compared with the measured residual: its predicted signals by file."""

    label: str
    style: Style
    signals: dict[str, Signals]


class _Series(NamedTuple):
    x: Floats
    y: Floats
    rms: float  # rms in units of the noise


def residual_pictures(
    rig: RigTable, runs: list[Prepared], scales: Scales, models: list[Overlay], effects: tuple[str, ...]
) -> list[Picture]:
    """One or two pictures for each named effect, then pictures of the residuals with the largest rms; two without effects.

    Args:
        rig: rig with the numbers of the baseline.
        runs: the measured runs.
        scales: scales of the rig.
        models: predictions to compare with, for every run.
        effects: the named effects.

    """
    wanted: list[Over] = []
    for effect in effects:
        row = CATALOGUE[effect]
        possible = [over for over in row.shown_by if any(len(part.x) for part in _all(rig, runs, scales, over))]
        wanted += [over for over in possible[: 2 if row.shown_twice else 1] if over not in wanted]
    for over in _standing_out(rig, runs):
        if len(wanted) < max(2, len(effects) + 1) and over[0] not in {residual for residual, _ in wanted}:
            wanted.append(over)
    return [_picture(rig, runs, scales, models, over) for over in wanted]


def _standing_out(rig: RigTable, runs: list[Prepared]) -> list[Over]:
    largest: dict[str, float] = {}
    for run in runs:
        for residual in parity_residuals(rig, run):
            largest[residual.name] = max(largest.get(residual.name, 0.0), residual.rms)
    seen = [name for name, rms in largest.items() if rms > _ROUNDING]
    return [(name, USUALLY_OVER[name]) for name in sorted(seen, key=lambda name: -largest[name])]


def _all(rig: RigTable, runs: list[Prepared], scales: Scales, over: Over) -> list[_Series]:
    return [_series(rig, run, scales, over) for run in runs]


def _series(rig: RigTable, run: Prepared, scales: Scales, over: Over) -> _Series:
    name, variable = over
    nothing = _Series(np.zeros(0), np.zeros(0), 0.0)
    if name == BREAKAWAY:
        above_N, columns = breakaways(rig, run, scales) if rig.drive == "spring" else (np.zeros(0), {})
        if len(above_N) == 0 or variable not in columns:
            return nothing
        return _Series(columns[variable], above_N, float(np.abs(above_N).max()))
    for residual in parity_residuals(rig, run):
        if residual.name == name and variable in residual.over:
            values = residual.values
            if variable == "force_N":
                values = _without_levels(values, residual.over["frequency_Hz"])
            return _Series(residual.over[variable], values, residual.rms)
    return nothing


def _without_levels(values: Floats, frequency_Hz: Floats) -> Floats:
    """`values` less their mean at each frequency, which would hide a dependence on the force."""
    result = values.copy()
    for each_Hz in np.unique(frequency_Hz):
        at = frequency_Hz == each_Hz
        result[at] -= values[at].mean()
    return result


def _picture(rig: RigTable, runs: list[Prepared], scales: Scales, models: list[Overlay], over: Over) -> Picture:
    name, variable = over
    x, y = X[variable], Y[name]
    title = TITLES[name]
    measured = _all(rig, runs, scales, over)
    if variable == "time_s" or name == "spring":
        # time and the zero of an extension differ from run to run, so only the run with the largest residual is drawn
        worst = max(range(len(runs)), key=lambda i: measured[i].rms)
        runs, measured = [runs[worst]], [measured[worst]]
        title += f" ({runs[0].file.rsplit('.', 1)[0]})"
    if variable == "force_N":
        title += " (less its mean at each frequency)"
    seen_x, seen_y = _joined(measured)
    cloud = np.linspace(0, len(seen_x) - 1, min(len(seen_x), _CLOUD)).astype(np.int64)
    curves = [Curve("measured", seen_x[cloud] * x.scale, seen_y[cloud] * y.scale, "points")]
    if variable != "dwell_s":
        curves.append(_line("measured, mean", "measured", seen_x, seen_y, over))
    for model in models:
        predicted = [run._replace(signals=model.signals[run.file]) for run in runs]
        curves.append(_line(model.label, model.style, *_joined(_all(rig, predicted, scales, over)), over))
    return Picture("residual", title, x.label, y.label, tuple(curves))


def _joined(series: list[_Series]) -> tuple[Floats, Floats]:
    return np.concatenate([part.x for part in series]), np.concatenate([part.y for part in series])


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
    mean_x = np.bincount(place, x, bins)[filled] / count[filled]
    mean_y = np.bincount(place, y, bins)[filled] / count[filled]
    if variable not in {"dwell_s", "frequency_Hz"}:
        holes = np.flatnonzero(np.diff(filled) > bins // 8) + 1
        mean_x, mean_y = np.insert(mean_x, holes, np.nan), np.insert(mean_y, holes, np.nan)
    return Curve(label, mean_x * X[variable].scale, mean_y * Y[name].scale, style)
