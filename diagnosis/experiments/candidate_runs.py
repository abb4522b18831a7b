"""Runs that could be measured next on a rig with a spring drive, sized by the speeds and vibrations already used."""

from typing import NamedTuple

import numpy as np

from diagnosis.features.feature import Scales
from diagnosis.features.grid import BLOCK_S
from diagnosis.features.segments import Segment
from diagnosis.features.slips import settled
from diagnosis.gap.prepare import Prepared
from diagnosis.gap.problem import Point, Problem
from diagnosis.model.segment_starts import entries_of

_LONGEST_S = 45.0  # longest proposed run; larger: more slow speeds, and more time to predict and to measure them
_SHORTEST_S = 4.0  # shortest drag, unless `_FARTHEST_M` limits it; smaller: few features at high speed
# Stick-slip cycles in a drag. Fewer: features of a cycle scatter. More: longer runs.
_CYCLES = 5.0
# Longest planned travel of a drag. Larger: a slide may not have the room. Smaller: fewer cycles at high speed.
_FARTHEST_M = 0.02
_LEAST_S = 1.0  # shortest run that can be diagnosed
_HOLDS_S = (1.0, 10.0, 30.0)  # durations of rests of the drive, far apart so that ageing of the contact shows
_WATCHED_S = 10.0  # additional effort of a run far outside the used speeds, in seconds of a run
# Shift of the start along the track; no multiple of a usual pitch, so that the run meets a periodic track in another phase.
_SHIFT_M = 3.7e-3


class ConstantSpeed(NamedTuple):
    """A stretch of constant command."""

    seconds: float
    velocity_mps: float
    frequency_Hz: float = 0.0
    amplitude_m: float = 0.0


class Plan(NamedTuple):
    """A run that could be measured."""

    what: str  # the instruction for the operator
    steps: tuple[ConstantSpeed, ...]
    shift_m: float = 0.0  # distance from the start of an earlier run to the start of the run
    beyond: bool = False  # whether the speed is far outside the used speeds, so that the rig may behave in a new way

    @property
    def effort_s(self) -> float:
        """Duration of the run, and `_WATCHED_S` more where the operator has to watch the rig."""
        return sum(step.seconds for step in self.steps) + (_WATCHED_S if self.beyond else 0.0)


def plans(problem: Problem) -> list[Plan]:
    """At most ten runs that the rig can make, by the evidence; empty if the drive never moved."""
    used = [segment for run in problem.runs for segment in run.commands.segments if segment.drive_velocity_mps != 0.0]
    if not used:
        return []
    length_s: dict[float, float] = {}
    for segment in used:
        speed = float(f"{abs(segment.drive_velocity_mps):.2g}")
        length_s[speed] = length_s.get(speed, 0.0) + (segment.last - segment.first) * BLOCK_S
    usual = max(length_s, key=lambda speed: length_s[speed])
    # a cycle of tiny slips counts as one of a tenth of the static friction, so that the run is long enough to compare
    falls_N = max(2.0 * (problem.rig.static_force_N - problem.rig.coulomb_force_N), 0.1 * problem.rig.static_force_N)
    cycle_m = falls_N / problem.scales.stiffness_N_per_m
    result: list[Plan] = []
    slowest, fastest = min(length_s), max(length_s)
    seen_m = max(abs(segment.drive_velocity_mps) * (segment.last - segment.first) * BLOCK_S for segment in used)
    for speed, beyond in ((0.2 * slowest, True), (0.5 * slowest, False), (2.0 * fastest, False), (5.0 * fastest, True)):
        travel_m = min(_travel_m(problem.scales, cycle_m), _FARTHEST_M)
        seconds = max(travel_m / speed, min(_SHORTEST_S, _FARTHEST_M / speed), _LEAST_S)
        if seconds <= _LONGEST_S and _LEAST_S * speed <= max(_FARTHEST_M, seen_m):
            instruction = f"Drag at {_speed(speed)} for {seconds:.2g} s without vibration."
            result.append(Plan(instruction, (ConstantSpeed(seconds, speed),), beyond=beyond))
    drag_s = max(_travel_m(problem.scales, 2.0 * cycle_m) / usual, 2.0)
    if drag_s * 3.0 <= _LONGEST_S:
        result += _other_profiles(usual, drag_s, cycle_m)
    result += _vibrations(used, usual, 2.0 * cycle_m / usual + 1.0)
    return result


def _other_profiles(usual: float, drag_s: float, cycle_m: float) -> list[Plan]:
    again_s = max(2.0 * cycle_m / usual, 1.0)
    holds = [step for hold_s in _HOLDS_S for step in (ConstantSpeed(hold_s, 0.0), ConstantSpeed(again_s, usual))]
    dwells = ", ".join(f"{hold_s:g}" for hold_s in _HOLDS_S)
    back = (ConstantSpeed(drag_s, usual), ConstantSpeed(drag_s, -usual))
    return [
        Plan(
            f"Drag at {_speed(usual)}, hold the drive for {dwells} s in turn, and drag on after each.",
            (ConstantSpeed(drag_s, usual), *holds),
        ),
        Plan(f"Drag at {_speed(usual)} for {drag_s:.0f} s, then back for {drag_s:.0f} s.", back),
        Plan(
            f"Drag at {_speed(usual)} for {drag_s:.0f} s, go back, wait 10 s, and drag along the same track again.",
            (*back, ConstantSpeed(10.0, 0.0), ConstantSpeed(drag_s, usual)),
        ),
        Plan(
            f"Drag at {_speed(usual)} for {drag_s:.0f} s from a start {_SHIFT_M * 1e3:.1f} mm further on.",
            (ConstantSpeed(drag_s, usual),),
            _SHIFT_M,
        ),
    ]


def _vibrations(used: list[Segment], usual: float, each_s: float) -> list[Plan]:
    """Runs at other frequencies and at other amplitudes of vibration; empty if no run was vibrated."""
    shaken = [segment for segment in used if segment.frequency_Hz > 0.0]
    if not shaken:
        return []
    highest_Hz = max(segment.frequency_Hz for segment in shaken)
    amplitude_m = float(np.median([segment.amplitude_m for segment in shaken]))
    each_s = min(max(each_s, 1.5), 3.0)
    frequencies = [share * highest_Hz for share in (0.5, 1.5, 2.0)]
    amplitudes = [share * amplitude_m for share in (0.5, 1.5, 2.0)]
    listed_kHz = ", ".join(f"{frequency_Hz * 1e-3:.3g}" for frequency_Hz in frequencies)
    listed_nm = ", ".join(f"{value_m * 1e9:.3g}" for value_m in amplitudes)
    return [
        Plan(
            f"Drag at {_speed(usual)} with {amplitude_m * 1e9:.3g} nm at {listed_kHz} kHz, {each_s:.1f} s each.",
            tuple(ConstantSpeed(each_s, usual, frequency_Hz, amplitude_m) for frequency_Hz in frequencies),
        ),
        Plan(
            f"Drag at {_speed(usual)} with {listed_nm} nm at {0.5 * highest_Hz * 1e-3:.3g} kHz, {each_s:.1f} s each.",
            tuple(ConstantSpeed(each_s, usual, 0.5 * highest_Hz, value_m) for value_m in amplitudes),
        ),
    ]


def as_run(problem: Problem, plan: Plan, point: Point) -> Prepared:
    """The plan as a prepared run whose measurement is the prediction of the model at `point`.

    It has the channels of the measured run with the most channels, with an exciter if the plan needs one.
    """
    with_exciter = any(step.frequency_Hz > 0.0 for step in plan.steps)
    template = max(
        problem.runs, key=lambda run: (with_exciter and bool(run.commands.frequency_Hz.any()), len(run.signals))
    )
    counts = [round(step.seconds / BLOCK_S) for step in plan.steps]
    edges = np.concatenate([[0], np.cumsum(counts)]).tolist()
    segments = tuple(
        Segment(first, last, *step[1:]) for first, last, step in zip(edges[:-1], edges[1:], plan.steps, strict=True)
    )
    drive, frequency_Hz, amplitude_m = (
        np.repeat(column, counts) for column in zip(*(step[1:] for step in plan.steps), strict=True)
    )
    commands = template.commands._replace(
        drive=drive, frequency_Hz=frequency_Hz, amplitude_m=amplitude_m, segments=segments
    )
    start = template.start._replace(position_m=template.start.position_m + plan.shift_m)
    run = template._replace(file=plan.what, holdout=False, commands=commands, start=start, entries=(), clipped={})
    signals = problem.signals(run, point)
    commands = commands._replace(segments=tuple(settled(signals, segment, problem.scales) for segment in segments))
    return run._replace(signals=signals, commands=commands, entries=entries_of(signals, commands, problem.scales))


def _travel_m(scales: Scales, cycle_m: float) -> float:
    """Drive travel that loads the spring and then shows `_CYCLES` cycles."""
    return 0.5 * scales.force_N / scales.stiffness_N_per_m + _CYCLES * cycle_m


def _speed(speed_mps: float) -> str:
    if speed_mps >= 1e-4:
        return f"{float(f'{speed_mps * 1e3:.2g}'):g} mm/s"
    return f"{speed_mps * 1e6:.2g} µm/s"
