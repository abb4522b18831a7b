"""All parts of `python -m bench trust`, in processes: as a result, as JSON and in words."""

import math
import statistics
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from bench.control.drawn import drawn_axes
from bench.control.rules import CONTROLLER, MOVING, NAMES
from bench.control.suite import each, run_one, warm_up
from bench.control.trust.disturbed import disturbances, disturbed_figures
from bench.control.trust.never import never_axes, never_figures
from bench.control.trust.restick import restick_figures, restick_runs
from bench.control.trust.trials import long_axes, trial_figures
from bridge.kernel_cache import compile_once

PARTS = ("drawn", "never", "disturbed", "restick", "trials")
# bars of a run, by figure: slips and surges that count, shares of the time of motion, time above 1.5 set points, trials
_BARS = {"wrong": 0.0, "above_2_v_d_share": 0.02, "excited_share": 0.05, "above_s": 0.2, "false": 0.0}
_BARS["in_trials_per_600_s"] = 1.0


class Case(NamedTuple):
    """One run."""

    part: str
    group: str  # runs that are summed up together
    name: str
    figures: dict[str, float]
    false_reports: list[str]
    cpu_s: float

    @property
    def missed(self) -> list[str]:
        """Its false reports, and the figures above their bars."""
        above = [f"{name} {value:.3g}" for name, value in self.figures.items() if value > _BARS.get(name, math.inf)]
        return [*self.false_reports, *above]


class Spread(NamedTuple):
    """One figure over the runs of a group."""

    total: float
    mean: float
    median: float
    worst: float
    missed: int  # number of runs above the bar


class Group(NamedTuple):
    """Runs of one part that are summed up together."""

    part: str
    group: str
    runs: int
    with_false_reports: int
    cpu_s: float
    figures: dict[str, Spread]


class TrustResult(NamedTuple):
    """The figures of each group, and every run."""

    groups: list[Group]
    cases: list[Case]

    def in_words(self) -> list[str]:
        """The figures, then a line for each run with a false report or a figure above its bar, and for each run with trials."""
        lines: list[str] = []
        for group in self.groups:
            head = f"{group.part}, {group.group}: {group.runs} runs, {group.with_false_reports} with false reports"
            lines.append(f"{head}, {group.cpu_s:.0f} s of CPU")
            for name, of in group.figures.items():
                texts = f"mean {of.mean:<10.4g}median {of.median:<10.4g}worst {of.worst:<10.4g}total {of.total:<10.4g}"
                lines.append(f"  {name:<20}{texts}{f'missed in {of.missed}' if name in _BARS else ''}".rstrip())
        missed = [case for case in self.cases if case.missed]
        lines += [f"{case.name:<30}{case.group}: {'; '.join(case.missed)}" for case in missed]
        trials = [case for case in self.cases if case.part == "trials"]
        return lines + [
            f"{case.name:<30}{of['in_trials']} slips and surges in {of['trials']} trials"
            for case in trials
            for of in [case.figures]
        ]


def trust(
    seed: int,
    parts: Sequence[str],
    counts: tuple[int, int, int],
    durations_s: tuple[float, float],
    rule: bool,
    jobs: int,
    progress: Callable[[float, str], None],
) -> TrustResult:
    """Run the parts.

    Args:
        seed: seed of the drawn axes and of the axes that never stick.
        parts: names of `PARTS`.
        counts: numbers of drawn axes, of axes that never stick, and of drawn axes with trials.
        durations_s: duration of the runs of axes that never stick, and of those with trials.
        rule: run the rule "1.2 v_d while it moves" too.
        jobs: number of processes.
        progress: called with the share done and a line on the last run.

    """
    subjects = (CONTROLLER, MOVING) if rule else (CONTROLLER,)
    axes = drawn_axes(seed, counts[0]) if "drawn" in parts else []
    never = never_axes(seed, counts[1], durations_s[0]) if "never" in parts else []
    trials = long_axes(seed, counts[2], durations_s[1]) if "trials" in parts else []
    entries = disturbances() if "disturbed" in parts else []
    if bank := [*axes, *never, *trials]:
        warm_up(bank[0])
    if entries:
        compile_once("the bench of disturbances", lambda: disturbed_figures(entries[0], CONTROLLER))
    plan = [
        *(("drawn", axis, subject) for axis in axes for subject in subjects),
        *(("never", axis, CONTROLLER) for axis in never),
        *(("disturbed", entry, subject) for entry in entries for subject in subjects),
        *(("restick", run, CONTROLLER) for run in (restick_runs() if "restick" in parts else [])),
        *(("trials", axis, CONTROLLER) for axis in trials),
    ]
    cases: list[Case] = []
    for case in each(_run, plan, jobs):
        cases.append(case)
        progress(len(cases) / len(plan), f"{case.name}, {case.group}: {'; '.join(case.missed) or 'no bar missed'}")
    keys = dict.fromkeys((case.part, case.group) for case in cases)
    groups = [_group([case for case in cases if (case.part, case.group) == key]) for key in keys]
    return TrustResult(groups, cases)


def _run(part: str, run: Any, rule: int) -> Case:
    started_s = time.process_time()
    reports: list[str] = []
    group = NAMES[rule]
    if part == "drawn":
        ran = run_one(run, rule).figures
        wrong = ran.slips + ran.surges
        figures = {"wrong": wrong, "above_2_v_d_share": ran.twice_share, "energy_ratio": ran.energy_ratio}
        group += ", with k_d" if ran.k_d_given else ", without k_d"
        reports = [] if wrong else ran.reports  # of an axis that is not held a report is true
    elif part == "never":
        figures, group = never_figures(run), run.name if run.name.partition("-")[0] != "never" else "drawn"
    elif part == "disturbed":
        figures, reports = disturbed_figures(run, rule)
        group += f", {run.about}"
    elif part == "trials":
        figures, group = trial_figures(run), "drawn"
    else:
        figures, group = restick_figures(run), run.family if run.family == "false" else run.name
    return Case(part, group, run.name, figures, reports, time.process_time() - started_s)


def _group(cases: Sequence[Case]) -> Group:
    first = cases[0]
    spreads: dict[str, Spread] = {}
    for name in first.figures:
        values = [case.figures[name] for case in cases]
        missed = sum(value > _BARS.get(name, math.inf) for value in values)
        spreads[name] = Spread(sum(values), statistics.fmean(values), statistics.median(values), max(values), missed)
    with_reports, cpu_s = sum(bool(case.false_reports) for case in cases), sum(case.cpu_s for case in cases)
    return Group(first.part, first.group, len(cases), with_reports, cpu_s, spreads)
