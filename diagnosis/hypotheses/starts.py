"""Starting points for the refit of a form: a function for each method, referenced by the rows of the catalogue.

They are only starting points, never a verdict.
"""

import math
from collections.abc import Callable, Iterable
from itertools import combinations
from typing import NamedTuple

import numpy as np

from bridge.arrays import Floats
from diagnosis.gap.problem import AGE_BEFORE, Problem
from diagnosis.hypotheses.hypothesis import Coordinate, Hypothesis, Scale, longest_run_s
from diagnosis.hypotheses.waves import (
    LOBES,
    MOST,
    Wave,
    WaveSeries,
    axis_waves,
    drive_series,
    friction_series,
    ringing_Hz,
    strongest_waves,
    two_waves,
    waves_apart,
    waves_beside,
)  # fmt: skip
from diagnosis.model.per_run import OTHER_PHASE, PHASE, name_and_run, of_run
from diagnosis.model.rig import AGE_BEFORE_S, AGE_SPREAD
from plant.effects.library import EFFECTS

_WAVES = 4  # ranges of periods that are searched
# Ranges of periods that are searched for waves with a harmonic: sines explain less than half of the variance of bumps.
_STEEP_WAVES = 2
# Starts of bumps in shares of the spread of a pitch: with half a percent of error a fit may end in a local minimum.
_BESIDE = (-0.25, 0.0, 0.25)
_STUCK = (1.05, 1.13)  # natural frequency of a base over the frequency at which it rings with the slide stuck to it
_AGE_LIMITS_S = (1e-3, 1e5)  # bounds of the contact's age: one block, one day


class Trial(NamedTuple):
    """A form and the start of its refit, [coordinates]."""

    hypothesis: Hypothesis
    w: Floats


# parameter, scale, whether it is logarithmic, prior, start of its coordinate
Axis = tuple[str, float, bool, float, float]


class TrialRequest(NamedTuple):
    """A form of an effect to try on an evidence."""

    name: str
    form: str
    scale: dict[str, Scale]  # scales of its free parameters
    problem: Problem
    highest_Hz: float  # highest frequency of the vibration

    def trial(self, start: dict[str, float], further: Iterable[Axis] = ()) -> Trial:
        """A trial from these values, or from the scales where a value is missing; `further` coordinates come last."""
        # a coordinate of either sign starts at half a unit; a positive coordinate at its scale
        axes = [
            (name, start.get(name, unit.scale), unit.logarithmic, unit.prior, 0.0 if unit.logarithmic else 0.5)
            for name, unit in self.scale.items()
        ]
        return _trial(self.name, self.form, [*axes, *further])


Starts = Callable[[TrialRequest], list[Trial]]


def at_scale(asked: TrialRequest) -> list[Trial]:
    """A single start, with every parameter at its scale."""
    return [asked.trial({})]


def at_values(parameter: str, *values: float) -> Starts:
    """A start at each of these values."""
    return lambda asked: [asked.trial({parameter: value}) for value in values]


def at_times_its_scale(parameter: str, *times: float) -> Starts:
    """A start at each of these multiples of the parameter's scale."""
    return lambda asked: [asked.trial({parameter: time * asked.scale[parameter].scale}) for time in times]


def at_times_the_vibration(parameter: str, *times: float) -> Starts:
    """A start at each of these multiples of the highest frequency of the vibration."""
    return lambda asked: [asked.trial({parameter: time * asked.highest_Hz}) for time in times]


def aged_before(asked: TrialRequest) -> list[Trial]:
    """A single start; the age of the contact at the beginning of each run is a free parameter."""
    of_runs = [
        (of_run(AGE_BEFORE, run.file), AGE_BEFORE_S, True, AGE_SPREAD, 0.0)
        for run in asked.problem.runs
        if any(entry.from_before for entry in run.entries)
    ]
    return [asked.trial({}, of_runs)]


def where_the_base_rings(asked: TrialRequest) -> list[Trial]:
    """A start at each frequency at which the base rings; without a peak at three frequencies."""
    rings_Hz = [times * f for f in ringing_Hz(asked.problem.runs, "base_accel_mps2", 2) for times in _STUCK]
    if not rings_Hz:
        return at_values("frequency_Hz", 50.0, 120.0, 300.0)(asked)
    # a narrow prior: the base swings several times in a slip, and a refit from a wrong frequency would miss a period
    near = {"frequency_Hz": asked.scale["frequency_Hz"]._replace(prior=0.1)}
    return at_values("frequency_Hz", *rings_Hz)(asked._replace(scale=asked.scale | near))


def waves_of_track(asked: TrialRequest) -> list[Trial]:
    """Waves of the friction along the track."""
    if asked.problem.rig.drive == "force":
        return _waves(asked, axis_waves(asked.problem.runs, "position", MOST))
    series = _friction(asked, "position")
    return _waves(asked, strongest_waves(series, _WAVES) + strongest_waves(series, _STEEP_WAVES, 2))


def waves_of_time(asked: TrialRequest) -> list[Trial]:
    """Waves of the friction over time, with one phase for all runs or a phase for each run."""
    if asked.problem.rig.drive == "force":
        return _waves(asked, axis_waves(asked.problem.runs, "time", MOST))
    series = _friction(asked, "time")
    return _waves(asked, strongest_waves(series, _WAVES) + waves_apart(series, asked.problem.runs, _WAVES))


def waves_of_screw(asked: TrialRequest) -> list[Trial]:
    """Waves of the drive's velocity along its way; without a drive position, of the friction along the track."""
    return _waves(asked, _drive_waves(asked, "position"))


def waves_of_motor(asked: TrialRequest) -> list[Trial]:
    """Waves of the drive's velocity over time; without a drive position, of the friction."""
    runs = asked.problem.runs
    series = drive_series(runs, "time") or _friction(asked, "time")
    return _waves(asked, _drive_waves(asked, "time") + waves_apart(series, runs, _WAVES))


def two_waves_of_track(asked: TrialRequest) -> list[Trial]:
    """Pairs of waves of the friction along the track."""
    if asked.problem.rig.drive == "force":
        pairs = list(combinations(axis_waves(asked.problem.runs, "position", MOST), 2))
    else:
        pairs = two_waves(_friction(asked, "position"), _WAVES)
    return [_two_waves_trial(asked.name, *pair) for pair in pairs]


def bumps_of_track(asked: TrialRequest) -> list[Trial]:
    """Bumps and dips where the friction along the track has its longest waves."""
    if asked.problem.rig.drive == "force":
        waves = axis_waves(asked.problem.runs, "position", MOST)
    else:
        series = _friction(asked, "position")
        waves = waves_beside(series, strongest_waves(series, _STEEP_WAVES, 2)[-LOBES:], _BESIDE)
    return [_bumps_trial(asked.name, wave, sign) for wave in waves for sign in (1.0, -1.0)]


def _friction(asked: TrialRequest, over: str) -> list[WaveSeries]:
    return friction_series(asked.problem.runs, asked.problem.scales, over)


def _drive_waves(asked: TrialRequest, over: str) -> list[Wave]:
    of_drive = strongest_waves(drive_series(asked.problem.runs, over), _WAVES, 2)
    return of_drive or strongest_waves(_friction(asked, over), _WAVES)


def _waves(asked: TrialRequest, waves: list[Wave]) -> list[Trial]:
    slowest_Hz = 1.0 / longest_run_s(asked.problem.runs)
    return [wave_trial(asked.name, asked.form, wave, slowest_Hz) for wave in waves]


def wave_trial(name: str, form: str, wave: Wave, slowest_Hz: float) -> Trial:
    """A form with a single wave that starts at `wave`; a wave over time must not be slower than `slowest_Hz`."""
    over_time = any(row.name == "frequency_Hz" for row in EFFECTS[name].forms[form].parameters)
    key, period = ("frequency_Hz", 1.0 / wave.period) if over_time else ("wavelength_m", wave.period)
    axes = [
        ("ratio", max(wave.ratio, 1e-4), True, 1.5, 0.0),
        (key, period, True, wave.spread, 0.0),
        *_phases({PHASE: wave.phase_rad} | dict(wave.phases_of)),
        ("second_sin", 0.4, False, 1.0, wave.second_sin / 0.4),
        ("second_cos", 0.4, False, 1.0, wave.second_cos / 0.4),
    ]
    return _trial(name, form, axes, slowest_Hz)


def _two_waves_trial(name: str, first: Wave, second: Wave) -> Trial:
    ratio = max(first.ratio, 1e-4)
    axes = [
        ("ratio", ratio, True, 1.5, 0.0),
        ("wavelength_m", first.period, True, first.spread, 0.0),
        *_phases({PHASE: first.phase_rad}),
        ("other_share", max(second.ratio / ratio, 0.05), True, 1.0, 0.0),
        ("other_wavelength_m", second.period, True, second.spread, 0.0),
        *_phases({OTHER_PHASE: second.phase_rad}),
    ]
    return _trial(name, "two-waves", axes)


def _bumps_trial(name: str, wave: Wave, sign: float) -> Trial:
    """Bumps where a wave is high (`sign` 1), or dips where it is low (`sign` -1)."""
    axes = [
        ("ratio", 2.0 * max(wave.ratio, 1e-4), False, 3.0, sign),
        ("wavelength_m", wave.period, True, wave.spread, 0.0),
        *_phases({PHASE: wave.phase_rad - sign * 0.5 * math.pi}),
        ("width", 0.12, True, 0.5, 0.0),
    ]
    return _trial(name, "bumps", axes)


def _phases(starts: dict[str, float]) -> list[Axis]:
    return [(phase, 1.0, False, 3.0, start) for phase, start in starts.items()]


def _trial(name: str, form: str, axes: list[Axis], slowest_Hz: float = 0.0) -> Trial:
    bounds = {row.name: (row.low, row.high) for row in EFFECTS[name].forms[form].parameters} | {
        AGE_BEFORE: _AGE_LIMITS_S
    }
    if "frequency_Hz" in bounds:
        # with a free phase in every run, a slower wave could imitate any trend, such as a tilted track
        bounds["frequency_Hz"] = max(bounds["frequency_Hz"][0], slowest_Hz), bounds["frequency_Hz"][1]
    coordinates = tuple(
        Coordinate(name, parameter, size, logarithmic, prior, *bounds[name_and_run(parameter)[0]])
        for parameter, size, logarithmic, prior, _ in axes
    )
    return Trial(Hypothesis({name: form}, coordinates), np.array([start for *_, start in axes]))
