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
from diagnosis.hypotheses.axis_waves import axis_waves
from diagnosis.hypotheses.hypothesis import Coordinate, Hypothesis
from diagnosis.hypotheses.ringing import ringing_Hz
from diagnosis.hypotheses.scales import Scale, longest_run_s
from diagnosis.hypotheses.waves import (
    Wave,
    drive_series,
    drive_waves,
    friction_series,
    friction_waves,
    friction_waves_beside,
    two_friction_waves,
    waves_apart,
)
from diagnosis.model.per_run import OTHER_PHASE, PHASE, of_run
from diagnosis.model.rig import AGE_BEFORE_S, AGE_SPREAD
from plant.effects.library import EFFECTS

_WAVES = 4  # ranges of periods that are searched
# Ranges of periods that are searched for waves with a harmonic: sines explain less than half of the variance of bumps.
_STEEP_WAVES = 2
# Bumps: number of the longest pitches that are tried, and further starts in shares of their spread: a fit from a pitch that is
# off by half a percent may end in a local minimum.
_LOBES_OF_BUMPS, _BESIDE = 2, (-0.25, 0.0, 0.25)
_STUCK = (1.05, 1.13)  # natural frequency of a base over the frequency at which it rings with the slide stuck to it
_AGE_LIMITS_S = (1e-3, 1e5)  # bounds of the contact's age: one block, one day
_AXIS_WAVES = 3  # waves that are tried on a force-driven axis, where strong waves are clear lines


class Trial(NamedTuple):
    """A form and the start of its refit, [coordinates]."""

    hypothesis: Hypothesis
    w: Floats


class TrialRequest(NamedTuple):
    """A form of an effect to try on an evidence."""

    name: str
    form: str
    scale: dict[str, Scale]  # scales of its free parameters
    problem: Problem
    highest_Hz: float  # highest frequency of the vibration

    def trial(self, start: dict[str, float], further: Iterable[Coordinate] = ()) -> Trial:
        """A trial from these values, or from the scales where a value is missing; `further` coordinates come last."""
        return _trial(self.name, self.form, self.scale, start, list(further))


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
        Coordinate(asked.name, of_run(AGE_BEFORE, run.file), AGE_BEFORE_S, True, AGE_SPREAD, *_AGE_LIMITS_S)
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
    runs, scales = asked.problem.runs, asked.problem.scales
    if asked.problem.rig.drive == "force":
        return _waves(asked, axis_waves(runs, "position", _AXIS_WAVES))
    waves = friction_waves(runs, scales, "position", _WAVES)
    return _waves(asked, waves + friction_waves(runs, scales, "position", _STEEP_WAVES, harmonics=2))


def waves_of_time(asked: TrialRequest) -> list[Trial]:
    """Waves of the friction over time, with one phase for all runs or a phase for each run."""
    runs, scales = asked.problem.runs, asked.problem.scales
    if asked.problem.rig.drive == "force":
        return _waves(asked, axis_waves(runs, "time", _AXIS_WAVES))
    waves = friction_waves(runs, scales, "time", _WAVES)
    return _waves(asked, waves + waves_apart(friction_series(runs, scales, "time"), runs, _WAVES))


def waves_of_screw(asked: TrialRequest) -> list[Trial]:
    """Waves of the drive's velocity along its way; without a drive position, of the friction along the track."""
    runs, scales = asked.problem.runs, asked.problem.scales
    waves = drive_waves(runs, "position", _WAVES) or friction_waves(runs, scales, "position", _WAVES)
    return _waves(asked, waves)


def waves_of_motor(asked: TrialRequest) -> list[Trial]:
    """Waves of the drive's velocity over time; without a drive position, of the friction."""
    runs, scales = asked.problem.runs, asked.problem.scales
    waves = drive_waves(runs, "time", _WAVES) or friction_waves(runs, scales, "time", _WAVES)
    series = drive_series(runs, "time") or friction_series(runs, scales, "time")
    return _waves(asked, waves + waves_apart(series, runs, _WAVES))


def two_waves_of_track(asked: TrialRequest) -> list[Trial]:
    """Pairs of waves of the friction along the track."""
    runs = asked.problem.runs
    if asked.problem.rig.drive == "force":
        pairs = list(combinations(axis_waves(runs, "position", _AXIS_WAVES), 2))
    else:
        pairs = two_friction_waves(runs, asked.problem.scales, _WAVES)
    return [_two_waves_trial(asked.name, *pair) for pair in pairs]


def bumps_of_track(asked: TrialRequest) -> list[Trial]:
    """Bumps and dips where the friction along the track has its longest waves."""
    runs, scales = asked.problem.runs, asked.problem.scales
    if asked.problem.rig.drive == "force":
        waves = axis_waves(runs, "position", _AXIS_WAVES)
    else:
        longest = friction_waves(runs, scales, "position", _STEEP_WAVES, harmonics=2)[-_LOBES_OF_BUMPS:]
        waves = friction_waves_beside(runs, scales, longest, _BESIDE)
    return [_bumps_trial(asked.name, wave, sign) for wave in waves for sign in (1.0, -1.0)]


def _waves(asked: TrialRequest, waves: list[Wave]) -> list[Trial]:
    slowest_Hz = 1.0 / longest_run_s(asked.problem.runs)
    return [wave_trial(asked.name, asked.form, wave, slowest_Hz) for wave in waves]


def _trial(name: str, form: str, scale: dict[str, Scale], start: dict[str, float], of_runs: list[Coordinate]) -> Trial:
    axes: list[Coordinate] = []
    for row in EFFECTS[name].forms[form].parameters:
        if row.name in scale:
            unit = scale[row.name]
            size = start.get(row.name, unit.scale)
            axes.append(Coordinate(name, row.name, size, unit.logarithmic, unit.prior, row.low, row.high))
    axes += of_runs
    # a coordinate of either sign starts at half a unit; a positive coordinate at its scale
    w = np.array([0.0 if axis.logarithmic else 0.5 for axis in axes])
    return Trial(Hypothesis({name: form}, tuple(axes)), w)


def wave_trial(name: str, form: str, wave: Wave, slowest_Hz: float) -> Trial:
    """A form with a single wave that starts at `wave`; a wave over time must not be slower than `slowest_Hz`."""
    axes: list[Coordinate] = []
    for row in EFFECTS[name].forms[form].parameters:
        if row.name == PHASE:
            axes += [Coordinate(name, phase, 1.0, False, 3.0, -20.0, 20.0) for phase in (PHASE, *wave.phases_of)]
        elif row.name == "ratio":
            axes.append(Coordinate(name, row.name, max(wave.ratio, 1e-4), True, 1.5, row.low, row.high))
        elif row.name in {"second_sin", "second_cos"}:
            axes.append(Coordinate(name, row.name, 0.4, False, 1.0, row.low, row.high))
        elif row.name == "frequency_Hz":
            # with a free phase in every run, a slower wave could imitate any trend, such as a tilted track
            axes.append(
                Coordinate(name, row.name, 1.0 / wave.period, True, wave.spread, max(row.low, slowest_Hz), row.high)
            )
        else:
            axes.append(Coordinate(name, row.name, wave.period, True, wave.spread, row.low, row.high))
    start = {PHASE: wave.phase_rad, "second_sin": wave.second_sin, "second_cos": wave.second_cos} | dict(wave.phases_of)
    w = np.array([start.get(axis.name, 0.0) / axis.scale for axis in axes])
    return Trial(Hypothesis({name: form}, tuple(axes)), w)


def _two_waves_trial(name: str, first: Wave, second: Wave) -> Trial:
    rows = {row.name: row for row in EFFECTS[name].forms["two-waves"].parameters}

    def positive(parameter: str, size: float, prior: float) -> Coordinate:
        return Coordinate(name, parameter, size, True, prior, rows[parameter].low, rows[parameter].high)

    ratio = max(first.ratio, 1e-4)
    axes = (
        positive("ratio", ratio, 1.5),
        positive("wavelength_m", first.period, first.spread),
        Coordinate(name, PHASE, 1.0, False, 3.0, -20.0, 20.0),
        positive("other_share", max(second.ratio / ratio, 0.05), 1.0),
        positive("other_wavelength_m", second.period, second.spread),
        Coordinate(name, OTHER_PHASE, 1.0, False, 3.0, -20.0, 20.0),
    )
    return Trial(
        Hypothesis({name: "two-waves"}, axes), np.array([0.0, 0.0, first.phase_rad, 0.0, 0.0, second.phase_rad])
    )


def _bumps_trial(name: str, wave: Wave, sign: float) -> Trial:
    """Bumps where a wave is high (`sign` 1), or dips where it is low (`sign` -1)."""
    rows = {row.name: row for row in EFFECTS[name].forms["bumps"].parameters}

    def axis(parameter: str, size: float, logarithmic: bool, prior: float) -> Coordinate:
        return Coordinate(name, parameter, size, logarithmic, prior, rows[parameter].low, rows[parameter].high)

    axes = (
        axis("ratio", 2.0 * max(wave.ratio, 1e-4), False, 3.0),
        axis("wavelength_m", wave.period, True, wave.spread),
        Coordinate(name, PHASE, 1.0, False, 3.0, -20.0, 20.0),
        axis("width", 0.12, True, 0.5),
    )
    return Trial(Hypothesis({name: "bumps"}, axes), np.array([sign, 0.0, wave.phase_rad - sign * 0.5 * math.pi, 0.0]))
