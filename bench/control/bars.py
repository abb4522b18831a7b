"""The figures of all runs together, against the bars."""

import math
import statistics
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from bench.control.figures import SILENT, Figures
from bench.control.oracle import LIMIT, TOO_LATE, Least
from bench.control.rules import MOVING, NAMES


class Bar(NamedTuple):
    """One line of the table: a requirement and the value of each subject."""

    name: str
    bar: str
    values: dict[str, str]  # value of each subject, in words
    holds: bool | None  # whether the controller holds the bar; None if no run could be judged


def bars(all_runs: Sequence[Figures], least: Mapping[str, Least], cost: float, controller: str) -> list[Bar]:
    """The table: one line for each bar.

    Args:
        all_runs: all runs of all subjects.
        least: least constant v_a / v_d of the long scenarios, by name.
        cost: time of a controller step over the time to simulate a block of the paper's rig.
        controller: name of the controller among the subjects.

    """
    subjects = list(dict.fromkeys(run.subject for run in all_runs))
    runs = {name: [run for run in all_runs if run.subject == name] for name in subjects}
    controlled = runs[controller]
    return [
        _recall(controlled, controller),
        _delay(controlled, controller),
        _false(controlled, controller),
        _clean(runs, controller),
        _slips(runs, controller),
        _energy(runs, controller),
        _over_least(runs, least, controller),
        _not_needed(runs, controller),
        _covered(runs, controller),
        _probing(controlled, controller),
        _above(controlled, controller),
        _words(controlled, controller),
        _taken(controlled, controller),
        _cost(cost, controller),
    ]


def _recall(controlled: list[Figures], controller: str) -> Bar:
    sticks, recalled = sum(run.sticks for run in controlled), sum(run.recalled for run in controlled)
    share = recalled / sticks if sticks else 1.0
    return Bar(
        "sticks announced",
        ">= 0.995",
        {controller: f"{share:.4f} ({recalled} of {sticks})"},
        share >= 0.995 if sticks else None,
    )


def _delay(controlled: list[Figures], controller: str) -> Bar:
    ratios = [ratio for run in controlled for ratio in run.late_ratios]
    delays_s = [delay for run in controlled for delay in run.delays_s]
    if not ratios:
        return Bar("re-stick to announcement", "<= max(12 ms, 5 sigma), median", {controller: "none"}, None)
    ratio = statistics.median(ratios)
    text = f"{1e3 * statistics.median(delays_s):.1f} ms, {ratio:.2f} of the allowed delay, medians"
    return Bar("re-stick to announcement", "<= max(12 ms, 5 sigma), median", {controller: text}, ratio <= 1.0)


def _false(controlled: list[Figures], controller: str) -> Bar:
    judged = [run for run in controlled if run.family == "false"] or controlled
    hours, count = sum(run.duration_s for run in judged) / 3600.0, sum(run.false_claims for run in judged)
    worst = max(judged, key=lambda run: run.false_claims)
    text = f"{count} in {hours:.2f} h" + (f"; {worst.false_claims} in {worst.scenario}" if count else "")
    held = count < max(hours, 1.0) and worst.false_claims <= 1
    return Bar("false announcements", "< 1 an hour, at most 1 in each condition", {controller: text}, held)


def _counted(runs: list[Figures]) -> list[Figures]:
    return [run for run in runs if run.expect == "helped"]


def _clean(runs: dict[str, list[Figures]], controller: str) -> Bar:
    def clean(name: str) -> tuple[int, int]:
        counted = _counted(runs[name])
        return sum(_is_clean(run) for run in counted), len(counted)

    values = {name: f"{clean(name)[0]} of {clean(name)[1]}" for name in runs}
    failed = [run for run in _counted(runs[controller]) if not _is_clean(run)]
    beyond = [run for run in failed if run.oracle is not None and run.oracle.verdict in {LIMIT, TOO_LATE}]
    values[controller] += f"; of the others no controller could hold {len(beyond)}" if beyond else ""
    good, all_of = clean(controller)
    return Bar("runs without slip and surge", ">= 97 %", values, good >= 0.97 * all_of if all_of else None)


def _is_clean(run: Figures) -> bool:
    return run.slips + run.surges == 0 and not any(line.startswith("refused") for line in run.failures)


def _slips(runs: dict[str, list[Figures]], controller: str) -> Bar:
    slips = {name: sum(run.slips + run.surges for run in _counted(runs[name])) for name in runs}
    values = {
        name: f"{sum(run.slips for run in _counted(runs[name]))} slips, {sum(run.surges for run in _counted(runs[name]))} surges"
        for name in runs
    }
    trials = [run for run in _counted(runs[controller]) if run.trial_slips]
    values[controller] += (
        f", {sum(run.trial_slips for run in trials)} more in trials of {sum(run.moving_s for run in trials):.0f} s"
    )
    energies = {name: _mean_energy(runs[name]) for name in runs}
    moving = next((name for name in runs if name == NAMES[MOVING]), None)
    if moving is None:
        return Bar("slips and surges", "fewer than 1.2 v_d whenever it moves", values, None)
    beaten = any(
        slips[name] <= slips[controller] and energies[name] <= energies[controller]
        for name in runs
        if name not in {controller, moving}
    )
    held = slips[controller] < slips[moving] or slips[controller] == slips[moving] == 0
    return Bar(
        "slips and surges", "fewer than 1.2 v_d whenever it moves; no rival has both less", values, held and not beaten
    )


def _mean_energy(runs: list[Figures]) -> float:
    counted = _counted(runs)
    return statistics.fmean(run.energy_ratio for run in counted) if counted else 0.0


def _energy(runs: dict[str, list[Figures]], controller: str) -> Bar:
    means = {name: _mean_energy(runs[name]) for name in runs}
    medians = {name: statistics.median([run.energy_ratio for run in _counted(runs[name])] or [0.0]) for name in runs}
    values = {name: f"mean {means[name]:.2f}, median {medians[name]:.2f}" for name in runs}
    moving = next((name for name in runs if name == NAMES[MOVING]), None)
    held = None if moving is None else means[controller] < means[moving] and medians[controller] < medians[moving]
    return Bar("mean v_a^2 over mean v_d^2 of a run", "less than 1.2 v_d whenever it moves", values, held)


def _over_least(runs: dict[str, list[Figures]], least: Mapping[str, Least], controller: str) -> Bar:
    """Mean v_a^2 from 10 s after the first announcement, over the least constant ratio (1.00 or more) squared.

    Only runs without slip and surge count: a controller that skips half of the strokes needs half of the energy.
    """

    def of(name: str, floor: bool) -> list[float]:
        known = {key: ratio.from_one if floor else ratio.of_all for key, ratio in least.items()}
        return sorted(
            run.settled_ratio / known[run.scenario] ** 2
            for run in runs[name]
            if run.settled_ratio > 0.0 and _is_clean(run) and math.isfinite(known.get(run.scenario, math.inf))
        )

    values: dict[str, str] = {}
    for name in runs:
        ratios = of(name, floor=True)
        if ratios:
            free = of(name, floor=False)
            values[name] = (
                f"median {statistics.median(ratios):.2f}, 90 % {_at(ratios, 0.9):.2f} of {len(ratios)} runs; "
                f"without the floor of 1.00: {statistics.median(free):.2f}, {_at(free, 0.9):.2f}"
            )
    controlled = of(controller, floor=True)
    held = statistics.median(controlled) <= 1.15 and _at(controlled, 0.9) <= 1.3 if controlled else None
    return Bar("energy over the energy of the least constant v_a / v_d", "<= 1.15 median, <= 1.3 in 90 %", values, held)


def _at(ordered: list[float], share: float) -> float:
    """The value that this share of the values does not exceed."""
    return ordered[min(math.ceil(share * len(ordered)), len(ordered)) - 1]


def _not_needed(runs: dict[str, list[Figures]], controller: str) -> Bar:
    def of(name: str) -> list[float]:
        return [run.excited_share for run in runs[name] if run.expect == "not-needed" and run.moving_s >= 150.0]

    values = {name: f"{100 * max(of(name)):.1f} %" for name in runs if of(name)}
    return Bar(
        "excited where nothing needs it, worst",
        "<= 2 %",
        values,
        max(of(controller)) <= 0.02 if of(controller) else None,
    )


def _covered(runs: dict[str, list[Figures]], controller: str) -> Bar:
    def share(name: str) -> float:
        blocks, short = sum(run.covered for run in runs[name]), sum(run.uncovered for run in runs[name])
        return 1.0 - short / blocks if blocks else math.nan

    values = {name: f"{100 * share(name):.3f} %" for name in runs if not math.isnan(share(name))}
    held = share(controller) >= 0.9995 if controller in values else None
    return Bar("v_a >= v_d while exciting", ">= 99.95 % of blocks", values, held)


def _probing(controlled: list[Figures], controller: str) -> Bar:
    long = [run for run in controlled if run.moving_s >= 45.0]
    worst = max((run.probe_share for run in long), default=0.0)
    return Bar(
        "probing, worst share of the moving time",
        "<= 2 %",
        {controller: f"{100 * worst:.1f} %"},
        worst <= 0.02 if long else None,
    )


def _above(controlled: list[Figures], controller: str) -> Bar:
    late = [run for run in controlled if run.above_s > run.above_limit_s + 1e-9]
    worst = max(controlled, key=lambda run: run.above_s)
    text = f"{len(late)} of {len(controlled)} runs longer; {1e3 * worst.above_s:.0f} ms in {worst.scenario}"
    return Bar("v_a above 1.3 times the wanted", "5 ms + a block at most", {controller: text}, not late)


def _words(controlled: list[Figures], controller: str) -> Bar:
    asked = [run for run in controlled if run.expect in {"helped", "blind", "cannot-help"}]
    silent = [run for run in asked if any(line.startswith(("BLIND", "EXCITER_END", SILENT)) for line in run.failures)]
    return Bar(
        "axes where it neither helps nor reports it",
        "0",
        {controller: f"{len(silent)} of {len(asked)}"},
        not silent if asked else None,
    )


def _taken(controlled: list[Figures], controller: str) -> Bar:
    refused = sum(any(line.startswith("refused") for line in run.failures) for run in controlled)
    return Bar("scenarios refused", "0", {controller: str(refused)}, refused == 0)


def _cost(cost: float, controller: str) -> Bar:
    """Shown without a bar: one version gave 0.05 on a busy computer and 0.12 on an idle one. Compare versions in turns."""
    return Bar(
        "cost of a step, in blocks of the paper's rig",
        "no bar; one version: 0.05 to 0.12",
        {controller: f"{cost:.3f}"},
        None,
    )
