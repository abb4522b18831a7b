"""Split of a single long run into parts to fit and a held-out part; shortening of long records before simulation."""

import math

import numpy as np
import numpy.typing as npt

from bridge.arrays import Floats
from bridge.log.finding import Finding
from diagnosis.evidence.run import Evidence, MeasuredRun

_SHORTEST_S = 12.0  # shortest run that is split: a third of it must hold some slips
_WINDOW_S = 0.1  # window over which speed and vibration count as constant
_PARTS = 3  # equal parts of the run; one of them is held out
# Total simulated time of the fitted and of the held-out runs. Less: few slips. More: minutes of work.
_FITTED_S, _HELD_OUT_S = 60.0, 30.0
_SHORTEST_EXCERPT_S = 5.0  # shortest simulated time of a run


def split(run: MeasuredRun) -> tuple[list[MeasuredRun], list[Finding]]:
    """The run in parts, one of them held out, and a finding that names it; a short run unchanged.

    The third whose speeds and vibrations occur most in the rest is held out; among equals the last third.
    """
    length_s = float(run.t_s[-1] - run.t_s[0])
    if length_s < _SHORTEST_S:
        return [run], []
    edges_s = run.t_s[0] + length_s / _PARTS * np.arange(_PARTS + 1)
    condition, at_s = _conditions(run)
    part = np.clip(np.searchsorted(edges_s, at_s, side="right") - 1, 0, _PARTS - 1)
    common = [_common(condition[part == held], condition[part != held]) for held in range(_PARTS)]
    held = max(range(_PARTS), key=lambda i: (round(common[i], 2), i))
    first_s, last_s = (edges_s[held : held + 2] - run.t_s[0]).tolist()
    until_s = last_s if held < _PARTS - 1 else math.inf  # else the last sample would be a separate stretch
    stretches = [(0.0, first_s), (first_s, until_s), (until_s, math.inf)]
    parts = [
        cut(run, begin_s, end_s)._replace(holdout=number == 1)
        for number, (begin_s, end_s) in enumerate(stretches)
        if begin_s < end_s
    ]
    text = (
        f"the only run: {first_s:.3g} to {last_s:.3g} s are held out, the third whose speeds and vibrations occur most in the "
        "rest; mark runs by from_s, until_s and holdout to choose for yourself"
    )
    return parts, [Finding("holdout", run.file, text)]


def cut(run: MeasuredRun, from_s: float, until_s: float) -> MeasuredRun:
    """A stretch of a run, in seconds since its first sample; its limits are added to the name of the file."""
    since_s = run.t_s - run.t_s[0]
    inside = (since_s >= from_s) & (since_s < until_s)
    stem, dot, suffix = run.file.rpartition(".")
    name = f"{stem}-{from_s:.4g}-to-{min(until_s, float(since_s[-1])):.4g}s{dot}{suffix}"
    return run._replace(
        file=name, t_s=run.t_s[inside], columns={key: values[inside] for key, values in run.columns.items()}
    )


def _conditions(run: MeasuredRun) -> tuple[npt.NDArray[np.int64], Floats]:
    """A number for the speed and the vibration in each window of 0.1 s, and the windows' instants, [windows]."""
    at_s = np.arange(run.t_s[0], run.t_s[-1], _WINDOW_S)
    first = np.searchsorted(run.t_s, at_s)
    position_m = run.columns.get("drive_position_m", run.columns.get("mass_position_m"))
    key = np.zeros(len(at_s), np.int64)
    if position_m is not None and len(at_s) > 1:
        speed = np.gradient(position_m[first], _WINDOW_S)
        fastest = float(np.abs(speed).max())
        if fastest > 0.0:  # octaves of the speed below the fastest, by direction
            octave = np.clip(np.round(-np.log2(np.maximum(np.abs(speed) / fastest, 1e-3))), 0, 9).astype(np.int64)
            key = 2 * octave + (speed > 0.0)
    amplitude, frequency = run.columns.get("vibration_amplitude_m"), run.columns.get("vibration_frequency_Hz")
    if amplitude is not None and frequency is not None:
        _, vibration = np.unique(np.where(amplitude[first] > 0.0, frequency[first], 0.0), return_inverse=True)
        key = key + 100 * vibration
    return key, at_s


def _common(held: npt.NDArray[np.int64], rest: npt.NDArray[np.int64]) -> float:
    """Share of the held-out windows whose condition occurs as often in the rest."""
    if not len(held) or not len(rest):
        return 0.0
    keys, counts = np.unique(held, return_counts=True)
    share = counts / len(held)
    return float(sum(min(part, float((rest == key).mean())) for key, part in zip(keys, share, strict=True)))


def excerpt(evidence: Evidence) -> Evidence:
    """The evidence with every run shortened by the same share if their sum is too long, and a finding about it."""
    allowed = {
        holdout: most_s / max(sum(_seconds(run) for run in evidence.runs if run.holdout == holdout), most_s)
        for holdout, most_s in ((False, _FITTED_S), (True, _HELD_OUT_S))
    }
    if min(allowed.values()) == 1.0:
        return evidence
    runs = tuple(
        run
        if allowed[run.holdout] == 1.0
        else cut(run, 0.0, max(_seconds(run) * allowed[run.holdout], _SHORTEST_EXCERPT_S))
        for run in evidence.runs
    )
    kept_s, total_s = (sum(_seconds(run) for run in group) for group in (runs, evidence.runs))
    text = f"{kept_s:.3g} of {total_s:.4g} s are simulated, from the start of every run; relations and shares use all of it"
    return evidence._replace(runs=runs, findings=(*evidence.findings, Finding("excerpt", "fits", text)))


def _seconds(run: MeasuredRun) -> float:
    return float(run.t_s[-1] - run.t_s[0])
