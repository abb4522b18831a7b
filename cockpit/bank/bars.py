"""The figures of all runs together, against the bars."""

import math
import statistics
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from cockpit.bank.figures import SILENT, Figures
from cockpit.bank.least import Least
from cockpit.bank.oracle import LIMIT, TOO_LATE
from cockpit.bank.rules import MOVING, NAMES


class Bar(NamedTuple):
    """One line of the table: what is asked for, and what each subject reaches."""

    name: str
    bar: str
    values: dict[str, str]  # of each subject, in words
    holds: bool | None  # for the controller; None where nothing was there to judge


def bars(found: Sequence[Figures], least: Mapping[str, Least], cost: float, own: str) -> list[Bar]:
    """The table.

    Args:
        found: all runs of all subjects.
        least: ratios of the long scenarios.
        cost: of a step of the controller, over that of a block of the paper's rig.
        own: name of the controller among the subjects.

    """
    subjects = list(dict.fromkeys(one.subject for one in found))
    runs = {name: [one for one in found if one.subject == name] for name in subjects}
    mine = runs[own]
    return [
        _recall(mine, own),
        _delay(mine, own),
        _false(mine, own),
        _clean(runs, own),
        _slips(runs, own),
        _energy(runs, own),
        _over_least(runs, least, own),
        _not_needed(runs, own),
        _covered(runs, own),
        _probing(mine, own),
        _above(mine, own),
        _words(mine, own),
        _taken(mine, own),
        _cost(cost, own),
    ]


def _recall(mine: list[Figures], own: str) -> Bar:
    sticks, recalled = sum(one.sticks for one in mine), sum(one.recalled for one in mine)
    share = recalled / sticks if sticks else 1.0
    return Bar(
        "sticks announced",
        ">= 0.995",
        {own: f"{share:.4f} ({recalled} of {sticks})"},
        share >= 0.995 if sticks else None,
    )


def _delay(mine: list[Figures], own: str) -> Bar:
    ratios = [ratio for one in mine for ratio in one.late_ratios]
    delays_s = [delay for one in mine for delay in one.delays_s]
    if not ratios:
        return Bar("re-stick to announcement", "<= max(12 ms, 5 sigma), median", {own: "none"}, None)
    ratio = statistics.median(ratios)
    text = f"{1e3 * statistics.median(delays_s):.1f} ms, {ratio:.2f} of what is soon enough, medians"
    return Bar("re-stick to announcement", "<= max(12 ms, 5 sigma), median", {own: text}, ratio <= 1.0)


def _false(mine: list[Figures], own: str) -> Bar:
    judged = [one for one in mine if one.family == "false"] or mine
    hours, count = sum(one.duration_s for one in judged) / 3600.0, sum(one.false_claims for one in judged)
    worst = max(judged, key=lambda one: one.false_claims)
    told = f"{count} in {hours:.2f} h" + (f"; {worst.false_claims} in {worst.scenario}" if count else "")
    held = count < max(hours, 1.0) and worst.false_claims <= 1
    return Bar("false announcements", "< 1 an hour, at most 1 in each condition", {own: told}, held)


def _counted(runs: list[Figures]) -> list[Figures]:
    return [one for one in runs if one.expect == "helped"]


def _clean(runs: dict[str, list[Figures]], own: str) -> Bar:
    def clean(name: str) -> tuple[int, int]:
        counted = _counted(runs[name])
        return sum(_is_clean(one) for one in counted), len(counted)

    values = {name: f"{clean(name)[0]} of {clean(name)[1]}" for name in runs}
    failed = [one for one in _counted(runs[own]) if not _is_clean(one)]
    beyond = [one for one in failed if one.oracle is not None and one.oracle.verdict in {LIMIT, TOO_LATE}]
    values[own] += f"; of the others no controller could hold {len(beyond)}" if beyond else ""
    good, all_of = clean(own)
    return Bar("runs without slip and surge", ">= 97 %", values, good >= 0.97 * all_of if all_of else None)


def _is_clean(one: Figures) -> bool:
    return one.slips + one.surges == 0 and not any(line.startswith("refused") for line in one.failures)


def _slips(runs: dict[str, list[Figures]], own: str) -> Bar:
    slips = {name: sum(one.slips + one.surges for one in _counted(runs[name])) for name in runs}
    values = {
        name: f"{sum(one.slips for one in _counted(runs[name]))} slips, {sum(one.surges for one in _counted(runs[name]))} surges"
        for name in runs
    }
    energies = {name: _mean_energy(runs[name]) for name in runs}
    moving = next((name for name in runs if name == NAMES[MOVING]), None)
    if moving is None:
        return Bar("slips and surges", "fewer than 1.2 v_d whenever it moves", values, None)
    beaten = any(
        slips[name] <= slips[own] and energies[name] <= energies[own] for name in runs if name not in {own, moving}
    )
    held = slips[own] < slips[moving] or slips[own] == slips[moving] == 0
    return Bar(
        "slips and surges", "fewer than 1.2 v_d whenever it moves; no rival has both less", values, held and not beaten
    )


def _mean_energy(runs: list[Figures]) -> float:
    counted = _counted(runs)
    return statistics.fmean(one.energy_ratio for one in counted) if counted else 0.0


def _energy(runs: dict[str, list[Figures]], own: str) -> Bar:
    means = {name: _mean_energy(runs[name]) for name in runs}
    medians = {name: statistics.median([one.energy_ratio for one in _counted(runs[name])] or [0.0]) for name in runs}
    values = {name: f"mean {means[name]:.2f}, median {medians[name]:.2f}" for name in runs}
    moving = next((name for name in runs if name == NAMES[MOVING]), None)
    held = None if moving is None else means[own] < means[moving] and medians[own] < medians[moving]
    return Bar("mean v_a^2 over mean v_d^2 of a run", "less than 1.2 v_d whenever it moves", values, held)


def _over_least(runs: dict[str, list[Figures]], least: Mapping[str, Least], own: str) -> Bar:
    """Mean v_a^2 from 10 s after the first announcement, over that of the least constant ratio of 1.00 or more.

    Of runs without slip and surge: who leaves half of the strokes alone needs half of the energy.
    """

    def of(name: str, floor: bool) -> list[float]:
        known = {key: ratio.from_one if floor else ratio.of_all for key, ratio in least.items()}
        return sorted(
            one.settled_ratio / known[one.scenario] ** 2
            for one in runs[name]
            if one.settled_ratio > 0.0 and _is_clean(one) and math.isfinite(known.get(one.scenario, math.inf))
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
    mine = of(own, floor=True)
    held = statistics.median(mine) <= 1.15 and _at(mine, 0.9) <= 1.3 if mine else None
    return Bar("energy over that of the least constant v_a / v_d", "<= 1.15 median, <= 1.3 in 90 %", values, held)


def _at(ordered: list[float], share: float) -> float:
    """The value that this share of them does not exceed."""
    return ordered[min(math.ceil(share * len(ordered)), len(ordered)) - 1]


def _not_needed(runs: dict[str, list[Figures]], own: str) -> Bar:
    def of(name: str) -> list[float]:
        return [one.excited_share for one in runs[name] if one.expect == "not-needed" and one.moving_s >= 150.0]

    values = {name: f"{100 * max(of(name)):.1f} %" for name in runs if of(name)}
    return Bar("excited where nothing needs it, worst", "<= 2 %", values, max(of(own)) <= 0.02 if of(own) else None)


def _covered(runs: dict[str, list[Figures]], own: str) -> Bar:
    def share(name: str) -> float:
        blocks, short = sum(one.covered for one in runs[name]), sum(one.uncovered for one in runs[name])
        return 1.0 - short / blocks if blocks else math.nan

    values = {name: f"{100 * share(name):.3f} %" for name in runs if not math.isnan(share(name))}
    held = share(own) >= 0.9995 if own in values else None
    return Bar("v_a >= v_d while exciting", ">= 99.95 % of blocks", values, held)


def _probing(mine: list[Figures], own: str) -> Bar:
    long = [one for one in mine if one.moving_s >= 45.0]
    worst = max((one.probe_share for one in long), default=0.0)
    return Bar(
        "probing, worst share of the moving time",
        "<= 2 %",
        {own: f"{100 * worst:.1f} %"},
        worst <= 0.02 if long else None,
    )


def _above(mine: list[Figures], own: str) -> Bar:
    late = [one for one in mine if one.above_s > one.above_limit_s + 1e-9]
    worst = max(mine, key=lambda one: one.above_s)
    told = f"{len(late)} of {len(mine)} runs longer; {1e3 * worst.above_s:.0f} ms in {worst.scenario}"
    return Bar("v_a above 1.3 times the wanted", "5 ms + a block at most", {own: told}, not late)


def _words(mine: list[Figures], own: str) -> Bar:
    asked = [one for one in mine if one.expect in {"helped", "blind", "cannot-help"}]
    silent = [one for one in asked if any(line.startswith(("BLIND", "CANNOT_HELP", SILENT)) for line in one.failures)]
    return Bar(
        "axes where it neither helps nor says so",
        "0",
        {own: f"{len(silent)} of {len(asked)}"},
        not silent if asked else None,
    )


def _taken(mine: list[Figures], own: str) -> Bar:
    refused = sum(any(line.startswith("refused") for line in one.failures) for one in mine)
    return Bar("scenarios refused", "0", {own: str(refused)}, refused == 0)


def _cost(cost: float, own: str) -> Bar:
    """Told, not judged: 0.05 beside other work and 0.12 alone, of the same step. Compare two versions in turns."""
    return Bar(
        "cost of a step, in blocks of the paper's rig", "told; 0.05 to 0.12 at first", {own: f"{cost:.3f}"}, None
    )
