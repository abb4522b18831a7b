"""The least constant v_a / v_d that leaves no slip and no surge on a scenario, found by trying: the measure of energy.

It is held from the start with the exciter's true gain and the drive's true velocity, as only a simulation can.
"""

import math
from typing import NamedTuple

import numpy as np

from bench.control import rules
from bench.control.run import Subject, judge, wrong_from
from bench.control.scenario import BankScenario

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
