"""How rough the surface is, and over which length: from the scatter of the friction, less the share that a wave explains."""

import math

import numpy as np

from bridge.arrays import Floats
from diagnosis.features.force_drive import friction_share
from diagnosis.features.grid import BLOCK_S
from diagnosis.gap.problem import Problem
from diagnosis.hypotheses.waves import WaveSeries, fitted, friction_series, strongest_waves
from diagnosis.model.rig import Roughness

ROUGHNESS = Roughness(0.003, 1.5e-4, 0)  # before the slips of the evidence show more
# Other surfaces, within a factor of two of 0.3 %, count as this many slips; a breakaway and a re-stick count as two. Pooled over
# the segments, the estimate is off by 28 % (rms over 26 rigs).
_SLIPS_OF_OTHERS = 8.0
_SMOOTHEST, _ROUGHEST = 1e-3, 0.15  # relative; of surfaces from polished to rubber on concrete
_FREEDOM = 5.0  # of a wave: sine, cosine, period and the choice among the periods
_RELATED = 0.2  # correlation of neighbours below which the length is shorter than their distance
_EVERY = 20  # blocks from one value of an axis to the next


def surface_of(problem: Problem, drawn: Floats) -> Roughness:
    """The surface; `drawn` [replicates, features] are features of the model on surfaces of `ROUGHNESS`."""
    series = {over: _series(problem, over) for over in ("position", "time")}
    left = min(_left_by_waves(part) for part in series.values())
    by_slips = ROUGHNESS.ratio * (times_rougher(problem, drawn) or 1.0)
    ratio = _of_axis(series["position"]) if problem.rig.drive == "force" else by_slips
    ratio = min(max(math.sqrt(left) * ratio, _SMOOTHEST), _ROUGHEST)
    return Roughness(ratio, _length_m(series["position"]), 0)


def _series(problem: Problem, over: str) -> list[WaveSeries]:
    """The friction, relative to its mean: of breakaways, or of all motion of an axis."""
    if problem.rig.drive != "force":
        return [part for part in friction_series(problem.runs, problem.scales, over) if part.of_slips]
    series: list[WaveSeries] = []
    for run in problem.runs:
        motion = run.commands.motion
        assert motion is not None, "a force drive has a motion"  # noqa: S101
        share, valid = friction_share(run.signals["drive_force_N"], motion)
        at = motion.position_m if over == "position" else np.arange(len(share)) * BLOCK_S
        series.append(WaveSeries(at[valid][::_EVERY], share[valid][::_EVERY], run=run.file))
    return series


def _of_axis(series: list[WaveSeries]) -> float:
    """From the median of the deviations, as reversals have larger deviations."""
    values = np.concatenate([part.value for part in series])
    return 1.48 * float(np.median(np.abs(values - np.median(values))))


def _left_by_waves(series: list[WaveSeries]) -> float:
    """Share of the scatter that the best wave leaves, for each degree of freedom that it leaves."""
    count = sum(len(part.value) - 1 for part in series)
    whole = sum(float(np.sum((part.value - part.value.mean()) ** 2)) for part in series)
    if count <= 2.0 * _FREEDOM or whole == 0.0:
        return 1.0
    periods = np.array([wave.period for wave in strongest_waves(series, 4)])
    best = float(fitted(series, periods)[0].max()) if len(periods) else 0.0
    return min((1.0 - best / whole) / (1.0 - _FREEDOM / count), 1.0)


def _length_m(series: list[WaveSeries]) -> float:
    """Correlation length, from neighbours of the friction along the track."""
    apart = [np.abs(np.diff(part.at)) for part in series if len(part.at) > 2]
    if not apart:
        return ROUGHNESS.length_m
    spacing = float(np.median(np.concatenate(apart)))
    about = [part.value - part.value.mean() for part in series]
    whole = sum(float(values @ values) for values in about)
    steps = sum(0.5 * float(np.sum(np.diff(values) ** 2)) for values in about)
    related = 1.0 - steps / max(whole, 1e-30)
    if related < _RELATED:
        return max(0.25 * spacing, 1e-9)
    reach = max(float(np.ptp(part.at)) for part in series)
    return min(spacing / -math.log(min(related, 0.999)), 0.25 * reach)


def times_rougher(problem: Problem, drawn: Floats) -> float | None:
    """Scatter of the slips over the scatter on surfaces of `ROUGHNESS`, drawn towards 1; None where no scatter is known."""
    segments = {run.file: run.commands.segments for run in problem.runs}
    slips = squares = 0.0
    for i, (file, label) in enumerate(problem.labels):
        if label.name != "scatter" or not np.isfinite(problem.measured[i]):
            continue
        known = drawn[np.isfinite(drawn[:, i]), i]
        if len(known) and known.mean() > 0.0:
            count = segments[file][label.segment].slips
            slips += count
            squares += count * problem.measured[i] / float(known.mean())
    if squares == 0.0:
        return None
    return math.sqrt(squares / slips) ** (slips / (slips + _SLIPS_OF_OTHERS))
