"""The best that knowledge of the true rig allows on a scenario: the least constant ratio without slips, and an oracle.

The least constant v_a / v_d that leaves no slip and no surge is found by trying, as the measure of energy. It is held from the
start with the exciter's true gain and the drive's true velocity, as only a simulation can.

The oracle has the same exciter. It knows v_d without noise and the gain of exciter and mount, vibrates at the full slew as soon
as there is a v_d, and holds the best of a few ratios, the whole stroke among them. One oracle sees v_d when it is there, another
one knows it beforehand, early enough for the slew and for the loop delay. Where even that one slips, nothing that is commanded
prevents it.
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

_WHOLE_STROKE = 1e3  # of v_d: more than any stroke reaches
_RATIOS = (1.2, 1.7, 2.4, _WHOLE_STROKE)
_LONGEST_SLEW_S = 1.0
_AS_OFTEN = 0.9  # of the controller's slips: where nothing helps, one more or less is chance
_SETTLED_S = 1.0  # after enabling, from when on a slip counts
_TO = 1.02  # the search ends where its two sides are so near
_FLOOR, _LOWEST, _HIGHEST, _STEP = 1.0, 0.25, 5.0, 1.25


class Least(NamedTuple):
    """Ratios v_a / v_d; infinite where none helps."""

    from_one: float  # the least that is 1.00 or more
    of_all: float  # the least of all down to 0.25


def is_clean(scenario: BankScenario, ratio: float, from_s: float) -> bool:
    """Whether a constant ratio leaves no slip and no surge after a time."""
    judged = judge(scenario, Subject(rules.CONSTANT, ratio), from_s)
    return not (judged.broken or np.any(wrong_from(judged.events, from_s)))


def least(scenario: BankScenario) -> Least:
    """Search to 2 %."""
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

    verdict: str  # one of the four above
    at_once: int  # slips and surges of the best ratio that begins with v_d
    beforehand: int  # of the best ratio that begins before v_d; not tried where `at_once` is 0
    ratio: float  # v_a / v_d of the best of all; infinite for the whole stroke

    def in_words(self, slips: int) -> str:
        """One line; `slips` is the number of slips and surges of the controller."""
        ratio = "at the whole stroke" if math.isinf(self.ratio) else f"at {self.ratio:g} v_d"
        beside = f", {self.beforehand} if it knows v_d early" if self.at_once else ""
        return f"{self.verdict} ({slips} here, {self.at_once} for an oracle vibrating at once{beside}; best {ratio})"


def ask(scenario: BankScenario, slips: int, from_s: float, at_s: float) -> tuple[Oracle, Curves | None]:
    """Run the oracles on a scenario; return their result and the curves of the best.

    Args:
        slips: slips and surges of the controller.
        from_s: from when on slips and surges count, for both.
        at_s: when the controller first failed, which the curves show.

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
    """How long the exciter takes to its whole stroke."""
    piezo = rig.piezo
    if piezo.amplitude_slew_m_per_s <= 0.0:
        return 0.0
    return min(piezo.amplitude_max_m / piezo.amplitude_slew_m_per_s, _LONGEST_SLEW_S)


def _best(scenario: BankScenario, ahead_s: float, from_s: float, at_s: float) -> tuple[int, float, Judged]:
    """Fewest slips and surges of the ratios, which ratio, and its run; no more are tried after one without."""
    runs: list[tuple[int, float, Judged]] = []
    for ratio in _RATIOS:
        judged = judge(scenario, Subject(rules.ORACLE, ratio, ahead_s), keep_at_s=at_s)
        runs.append((int(wrong_from(judged.events, from_s).sum()), ratio, judged))
        if runs[-1][0] == 0:
            break
    return min(runs, key=lambda run: run[0])
