"""The best that knowledge of the true rig allows on a scenario: the least constant ratio without slips, and an oracle.

The least constant v_a / v_d that leaves no slip and no surge is found by trial; the controller's energy is compared with it. It
is held from the start with the exciter's true gain and the drive's true velocity, which only a simulation knows.

The oracle has the same exciter. It knows v_d without noise and the gain of exciter and mount, vibrates at the full slew as soon
as the drive moves, and holds the best of a few ratios, the whole stroke among them. One oracle knows the present v_d, another
knows it beforehand, early enough for the slew and the loop delay. Slips of even the second oracle are slips that no command
prevents.
"""

import math
from typing import NamedTuple

import numpy as np

from bench.control import rules
from bench.control.run import Curves, Judged, Subject, judge, wrong_from
from bench.control.scenario import BankScenario
from plant.config import RigConfig

MISSED = "missed: the oracle does not slip"
TOO_LATE = "too late to know: only an oracle that knows v_d beforehand does not slip"
IN_PART = "a physical limit in part: the oracle slips too, less often"
LIMIT = "physical limit: the oracle slips too"

_WHOLE_STROKE = 1e3  # v_a / v_d that no stroke reaches: the oracle uses the whole stroke
_RATIOS = (1.2, 1.7, 2.4, _WHOLE_STROKE)  # v_a / v_d that an oracle tries
_LONGEST_SLEW_S = 1.0  # longest time for the slew by which an oracle knows v_d beforehand
_AS_OFTEN = 0.9  # share of the controller's slips from which an oracle slips as often: one more or less is chance
_SETTLED_S = 1.0  # time after enabling from which a slip counts
_TO = 1.02  # ratio without slips over the largest ratio with slips at which the search ends
_FLOOR, _LOWEST, _HIGHEST, _STEP = 1.0, 0.25, 5.0, 1.25  # tried v_a / v_d: first, least, largest; factor of a step up


class Least(NamedTuple):
    """Least constant v_a / v_d without slip or surge; infinite if no ratio prevents them."""

    from_one: float  # least of the ratios from 1.00 on
    of_all: float  # least of the ratios from 0.25 on


def is_clean(scenario: BankScenario, ratio: float, from_s: float) -> bool:
    """Whether a constant ratio leaves no slip and no surge after a time."""
    judged = judge(scenario, Subject(rules.CONSTANT, ratio), from_s)
    return not (judged.broken or np.any(wrong_from(judged.events, from_s)))


def least(scenario: BankScenario) -> Least:
    """Search the least constant ratios of a scenario, to 2 %."""
    from_s = scenario.enabled_from_s + _SETTLED_S
    if is_clean(scenario, _FLOOR, from_s):
        if is_clean(scenario, _LOWEST, from_s):
            return Least(_FLOOR, _LOWEST)
        return Least(_FLOOR, _between(scenario, from_s, _LOWEST, _FLOOR))
    slips, ratio = _FLOOR, _FLOOR
    while ratio < _HIGHEST:
        slips, ratio = ratio, ratio * _STEP
        if is_clean(scenario, ratio, from_s):
            between = _between(scenario, from_s, slips, ratio)
            return Least(between, between)
    return Least(math.inf, math.inf)


def _between(scenario: BankScenario, from_s: float, slips: float, clean: float) -> float:
    while clean > _TO * slips:
        middle = math.sqrt(slips * clean)
        if is_clean(scenario, middle, from_s):
            clean = middle
        else:
            slips = middle
    return clean


class Oracle(NamedTuple):
    """The oracle's result where the controller has slips or surges; both count from the same time on."""

    verdict: str  # MISSED, TOO_LATE, IN_PART or LIMIT
    at_once: int  # slips and surges of the oracle that knows the present v_d, at its best ratio
    beforehand: int  # the same for the oracle that knows v_d beforehand; not run where `at_once` is 0
    ratio: float  # v_a / v_d of the oracle with the fewest slips and surges; infinite for the whole stroke

    def in_words(self, slips: int) -> str:
        """One line; `slips` is the number of slips and surges of the controller."""
        ratio = "at the whole stroke" if math.isinf(self.ratio) else f"at {self.ratio:g} v_d"
        if_early = f", {self.beforehand} if it knows v_d early" if self.at_once else ""
        return f"{self.verdict} (controller: {slips}, oracle vibrating at once: {self.at_once}{if_early}; best {ratio})"


def ask(scenario: BankScenario, slips: int, from_s: float, at_s: float) -> tuple[Oracle, Curves | None]:
    """Run the oracles on a scenario; return their result and the curves of the best.

    Args:
        slips: number of slips and surges of the controller.
        from_s: time from which slips and surges count, for controller and oracles.
        at_s: time of the controller's first slip or surge, which the curves show.

    """
    at_once, ratio, best = _best(scenario, -1.0, from_s, at_s)
    beforehand = at_once
    if at_once:
        count, other_ratio, judged = _best(scenario, slew_s(scenario.rig), from_s, at_s)
        if count < at_once:
            beforehand, ratio, best = count, other_ratio, judged
    parts = [part for part in best.kept if part.begin_s <= at_s < part.begin_s + len(part.rows) * part.step_s]
    shown = math.inf if ratio == _WHOLE_STROKE else ratio
    return Oracle(verdict(slips, at_once, beforehand), at_once, beforehand, shown), parts[0] if parts else None


def verdict(slips: int, at_once: int, beforehand: int) -> str:
    """Verdict from the counts of slips and surges of controller and oracles."""
    if at_once == 0:
        return MISSED
    if beforehand == 0:
        return TOO_LATE
    return LIMIT if beforehand >= _AS_OFTEN * slips else IN_PART


def slew_s(rig: RigConfig) -> float:
    """Time in which the exciter slews to its whole stroke, 1 s at most."""
    piezo = rig.piezo
    if piezo.amplitude_slew_m_per_s <= 0.0:
        return 0.0
    return min(piezo.amplitude_max_m / piezo.amplitude_slew_m_per_s, _LONGEST_SLEW_S)


def _best(scenario: BankScenario, ahead_s: float, from_s: float, at_s: float) -> tuple[int, float, Judged]:
    """Fewest slips and surges of all tried ratios, that ratio and its run; a ratio without slips ends the trials."""
    runs: list[tuple[int, float, Judged]] = []
    for ratio in _RATIOS:
        judged = judge(scenario, Subject(rules.ORACLE, ratio, ahead_s), keep_at_s=at_s)
        runs.append((int(wrong_from(judged.events, from_s).sum()), ratio, judged))
        if runs[-1][0] == 0:
            break
    return min(runs, key=lambda run: run[0])
