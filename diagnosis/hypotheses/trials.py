"""What is tried on an evidence: every effect of the plant in each of its formulas, with the coordinates and starts of its refit.

Scales come from the rig, so that a step of 1 in a coordinate is an effect that one would notice, on any rig.
"""

import math
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from diagnosis.gap.problem import AGE_BEFORE, AGEING, Problem
from diagnosis.hypotheses.axis_waves import axis_waves
from diagnosis.hypotheses.hypothesis import Coordinate, Hypothesis
from diagnosis.hypotheses.ringing import ringing_Hz
from diagnosis.hypotheses.scales import Scale, longest_run_s, scales
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

Floats = npt.NDArray[np.floating[Any]]
_WAVES = 4  # ranges of periods that are searched
# of waves with a harmonic: bumps of 3.14 mm had 0.38 of the breakaways' sum of squares as sines, 0.90 with it
_STEEP_WAVES = 2
# Of bumps the longest pitches are tried, and a quarter of their spread to either side: bumps of 1.30 mm came to chi2 641 from
# 1.306 mm, to 131 from 1.295.
_LOBES_OF_BUMPS, _BESIDE = 2, (-0.25, 0.0, 0.25)
_STUCK = (1.05, 1.13)  # own frequency of a base over the one at which it rings with the slide stuck to it
_AGE_LIMITS_S = (1e-3, 1e5)  # a block, a day
_AXIS_WAVES = 3  # of a force-driven axis, where a line stands out


class Trial(NamedTuple):
    """A form and where its refit starts."""

    hypothesis: Hypothesis
    w: Floats


def trials(problem: Problem) -> list[Trial]:
    """Every form of every effect that this rig can have and these runs could show."""
    rig, runs = problem.rig, problem.runs
    frequencies = np.concatenate([run.commands.frequency_Hz for run in runs])
    highest_Hz = float(frequencies.max())
    found: list[Trial] = []
    for name, effect in EFFECTS.items():
        if rig.drive not in effect.drives or (effect.acts_on == "piezo" and highest_Hz == 0.0):
            continue
        for form in effect.forms:
            if form != "random":  # no prediction follows its path: `diagnosis.random_friction`
                found += _starts(name, form, problem, highest_Hz)
    return found


def _starts(name: str, form: str, problem: Problem, highest_Hz: float) -> list[Trial]:
    rig, runs = problem.rig, problem.runs
    scale = scales(name, form, rig, runs, highest_Hz)
    if form == "two-waves":
        if rig.drive == "force":
            pairs = list(combinations(axis_waves(runs, "position", _AXIS_WAVES), 2))
        else:
            pairs = two_friction_waves(runs, problem.scales, _WAVES)
        return [_two_waves_trial(name, *pair) for pair in pairs]
    if form == "bumps":
        if rig.drive == "force":
            waves = axis_waves(runs, "position", _AXIS_WAVES)
        else:
            longest = friction_waves(runs, problem.scales, "position", _STEEP_WAVES, harmonics=2)[-_LOBES_OF_BUMPS:]
            waves = friction_waves_beside(runs, problem.scales, longest, _BESIDE)
        return [_bumps_trial(name, wave, sign) for wave in waves for sign in (1.0, -1.0)]
    waves: list[Wave] = []
    if rig.drive == "force" and PHASE in scale:
        waves = axis_waves(runs, "position" if "wavelength_m" in scale else "time", _AXIS_WAVES)
    elif name == "position-dependent-friction":
        waves = friction_waves(runs, problem.scales, "position", _WAVES)
        waves += friction_waves(runs, problem.scales, "position", _STEEP_WAVES, harmonics=2)
    elif name == "normal-load-fluctuation":
        waves = friction_waves(runs, problem.scales, "time", _WAVES)
        waves += waves_apart(friction_series(runs, problem.scales, "time"), runs, _WAVES)
    elif name == "drive-speed-ripple":
        over = "position" if form == "screw" else "time"
        waves = drive_waves(runs, over, _WAVES) or friction_waves(runs, problem.scales, over, _WAVES)
        if form == "time":
            waves += waves_apart(drive_series(runs, over) or friction_series(runs, problem.scales, over), runs, _WAVES)
    if PHASE in scale:
        return [wave_trial(name, form, wave, 1.0 / longest_run_s(runs)) for wave in waves]
    starts: list[dict[str, float]] = [{}]
    if name == "frame-compliance":
        starts = [{"frequency_Hz": f} for f in (40.0, 90.0, 200.0)]
    elif name == "base-compliance":
        rings_Hz = [times * f for f in ringing_Hz(runs, "base_accel_mps2", 2) for times in _STUCK]
        if rings_Hz:  # several turns a slip: further off, a refit ends a turn away
            scale |= {"frequency_Hz": scale["frequency_Hz"]._replace(prior=0.1)}
        starts = [{"frequency_Hz": f} for f in rings_Hz or (50.0, 120.0, 300.0)]
    elif name == "frictional-lag" and form == "distance":
        starts = [{"distance_m": times * scale["distance_m"].scale} for times in (0.4, 1.0, 3.0)]
    elif name == "frictional-lag" and form == "dead-time":
        starts = [{"delay_s": times * scale["delay_s"].scale} for times in (0.4, 2.5)]
    elif name == "piezo-roll-off":  # beside a drift, one of 4 kHz came to chi2 860 from 9 kHz, to 201 from 4
        starts = [{"corner_Hz": share * highest_Hz} for share in (0.9, 2.0)]
    elif name == "piezo-resonance":
        starts = [{"resonance_Hz": share * highest_Hz} for share in (0.5, 0.75, 0.9, 1.2, 2.0)]
    of_runs: list[Coordinate] = []
    if name == AGEING:
        of_runs = [
            Coordinate(name, of_run(AGE_BEFORE, run.file), AGE_BEFORE_S, True, AGE_SPREAD, *_AGE_LIMITS_S)
            for run in runs
            if any(entry.from_before for entry in run.entries)
        ]
    return [_trial(name, form, scale, start, of_runs) for start in starts]


def _trial(name: str, form: str, scale: dict[str, Scale], start: dict[str, float], of_runs: list[Coordinate]) -> Trial:
    axes: list[Coordinate] = []
    for row in EFFECTS[name].forms[form].parameters:
        if row.name in scale:
            unit = scale[row.name]
            size = start.get(row.name, unit.scale)
            axes.append(Coordinate(name, row.name, size, unit.logarithmic, unit.prior, row.low, row.high))
    axes += of_runs
    # a coordinate that may have either sign starts at half a unit; one that stays positive at its scale
    w = np.array([0.0 if axis.logarithmic else 0.5 for axis in axes])
    return Trial(Hypothesis({name: form}, tuple(axes)), w)


def wave_trial(name: str, form: str, wave: Wave, slowest_Hz: float) -> Trial:
    """A form of one wave, from where the wave is. What turns slower than `slowest_Hz` is no wave over time."""
    axes: list[Coordinate] = []
    for row in EFFECTS[name].forms[form].parameters:
        if row.name == PHASE:
            axes += [Coordinate(name, one, 1.0, False, 3.0, -20.0, 20.0) for one in (PHASE, *wave.phases_of)]
        elif row.name == "ratio":
            axes.append(Coordinate(name, row.name, max(wave.ratio, 1e-4), True, 1.5, row.low, row.high))
        elif row.name in {"second_sin", "second_cos"}:
            axes.append(Coordinate(name, row.name, 0.4, False, 1.0, row.low, row.high))
        elif row.name == "frequency_Hz":
            # in a phase of its own in every run it would be any trend: a tilted track was named a load of 0.06 Hz in runs of 10 s
            axes.append(
                Coordinate(name, row.name, 1.0 / wave.period, True, wave.spread, max(row.low, slowest_Hz), row.high)
            )
        else:
            axes.append(Coordinate(name, row.name, wave.period, True, wave.spread, row.low, row.high))
    start = {PHASE: wave.phase_rad, "second_sin": wave.second_sin, "second_cos": wave.second_cos} | dict(wave.phases_of)
    w = np.array([start.get(axis.name, 0.0) / axis.scale for axis in axes])
    return Trial(Hypothesis({name: form}, tuple(axes)), w)


def _two_waves_trial(name: str, first: Wave, other: Wave) -> Trial:
    rows = {row.name: row for row in EFFECTS[name].forms["two-waves"].parameters}

    def positive(parameter: str, size: float, prior: float) -> Coordinate:
        return Coordinate(name, parameter, size, True, prior, rows[parameter].low, rows[parameter].high)

    ratio = max(first.ratio, 1e-4)
    axes = (
        positive("ratio", ratio, 1.5),
        positive("wavelength_m", first.period, first.spread),
        Coordinate(name, PHASE, 1.0, False, 3.0, -20.0, 20.0),
        positive("other_share", max(other.ratio / ratio, 0.05), 1.0),
        positive("other_wavelength_m", other.period, other.spread),
        Coordinate(name, OTHER_PHASE, 1.0, False, 3.0, -20.0, 20.0),
    )
    return Trial(
        Hypothesis({name: "two-waves"}, axes), np.array([0.0, 0.0, first.phase_rad, 0.0, 0.0, other.phase_rad])
    )


def _bumps_trial(name: str, wave: Wave, sign: float) -> Trial:
    """Bumps where a wave is high, or dips where it is low."""
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
