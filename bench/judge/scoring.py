"""Right, wrong and cost of every method, over all cases and set by set.

A method ranks effects and none; `outside` is a second question. Names of a pair count for both, with their common probability.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from bench.blind.calibration import calibration_error
from bench.blind.intervals import mean
from bench.judge.cases import Case
from bench.judge.methods import Answer, Given

OUTSIDE, NONE = "outside", "none"
_HALF, _SURE = 0.5, 0.8
# Probability from which a name counts in the F1 of a pair, two names at most. Larger: trees name one of two.
_NAMED = 0.25


class Outcome(NamedTuple):
    """One answer and the truth."""

    case: Case
    given: Given

    @property
    def ranked(self) -> list[tuple[str, float]]:
        """Effects and none with their probabilities, the largest first."""
        total: Answer = {}
        for name, probability in self.given.probabilities.items():
            if name != OUTSIDE:
                for effect in name.split(" + "):
                    total[effect] = total.get(effect, 0.0) + probability
        return sorted(total.items(), key=lambda pair: -pair[1])

    @property
    def first(self) -> str:
        """The leading name; empty without an answer."""
        return self.ranked[0][0] if self.ranked else ""

    @property
    def outside(self) -> bool:
        """Whether the answer is that the library does not explain the rig, or no effect has half of the probability."""
        names = [probability for name, probability in self.ranked if name != NONE]
        return self.given.probabilities.get(OUTSIDE, 0.0) >= _HALF or max(names, default=0.0) < _HALF

    @property
    def f1(self) -> float:
        """F1 score of the names against the effects."""
        named = {name for name, probability in self.ranked[:2] if name != NONE and probability >= _NAMED}
        together = len(named) + len(self.case.effects)
        return 2.0 * len(named & self.case.effects) / together if together else 1.0

    @property
    def right(self) -> bool:
        """Whether the leading answer is the truth."""
        kind, outside = self.case.kind, self.given.probabilities.get(OUTSIDE, 0.0) >= _HALF
        if not self.ranked:
            return False
        if kind == "outside":
            return self.outside
        if kind == "none" or (kind == "measured" and not self.case.effects):
            return self.first == NONE and not outside
        wanted = self.case.effects or {self.case.number}
        return self.first in wanted

    @property
    def sure_of_wrong(self) -> bool:
        """Whether an effect that the rig lacks has more than 0.8."""
        lacks = [p for name, p in self.ranked if name not in {*self.case.effects, NONE, self.case.number}]
        if self.case.kind == "outside":
            lacks = [p for name, p in self.ranked if name != NONE]
        return max(lacks, default=0.0) > _SURE

    @property
    def judged(self) -> tuple[float, bool]:
        """Probability of the leading answer, outside among them, and whether it is right."""
        answers = [*self.ranked, (OUTSIDE, self.given.probabilities.get(OUTSIDE, 0.0))]
        name, probability = max(answers, key=lambda pair: pair[1])
        right = name == OUTSIDE if self.case.kind == "outside" else name == self.first and self.right
        return probability, right

    @property
    def words(self) -> str:
        """The answer in a few words: a mark, the leading name with its probability, and outside from a half on."""
        if not self.ranked:
            return "? " + (self.given.fault[:24] or "no answer")
        name, probability = self.ranked[0]
        beyond = self.given.probabilities.get(OUTSIDE, 0.0)
        return f"{'+' if self.right else '-'} {name} {probability:.2f}" + (
            f" out {beyond:.2f}" if beyond >= _HALF else ""
        )


class Figures(NamedTuple):
    """Figures of a method over chosen cases; rates as right and all."""

    method: str
    answered: int
    first: tuple[int, int]  # singles of 2 limits or more whose effect leads
    in_three: tuple[int, int]  # or is among the first three
    pair_f1: float | None
    alarms: tuple[int, int]  # rigs without a gap that get a name or "outside"
    outside: tuple[int, int]  # effects outside the library that get no name with half of the probability
    called_outside: tuple[int, int]  # effects of the library for which outside has half of the probability
    numbers: tuple[int, int]  # wrong numbers named
    measured: tuple[int, int]  # measured logs whose known cause leads
    sure_of_wrong: tuple[int, int]
    calibration: float | None
    cpu_median_s: float | None
    cpu_mean_s: float | None


def figures(method: str, outcomes: Sequence[Outcome]) -> Figures:
    """The figures of one method."""
    answered = [outcome for outcome in outcomes if outcome.ranked]
    cpu_s = [outcome.given.cpu_s for outcome in answered if outcome.given.cpu_s is not None]

    def of(*kinds: str) -> list[Outcome]:
        return [outcome for outcome in answered if outcome.case.kind in kinds]

    def count(chosen: Sequence[Outcome], hit: Callable[[Outcome], bool]) -> tuple[int, int]:
        return sum(hit(outcome) for outcome in chosen), len(chosen)

    singles = [outcome for outcome in of("single") if outcome.case.visible]
    error = calibration_error([outcome.judged for outcome in of("single", "none", "outside")])
    pairs = mean([outcome.f1 for outcome in of("pair")])
    return Figures(
        method=method,
        answered=len(answered),
        first=count(singles, lambda outcome: outcome.right),
        in_three=count(singles, lambda outcome: outcome.case.effects <= {name for name, _ in outcome.ranked[:3]}),
        pair_f1=pairs and round(pairs.value, 3),
        alarms=count(of("none"), lambda outcome: not outcome.right),
        outside=count(of("outside"), lambda outcome: outcome.right),
        called_outside=count(
            of("single", "pair"), lambda outcome: outcome.given.probabilities.get(OUTSIDE, 0.0) >= _HALF
        ),
        numbers=count(of("number"), lambda outcome: outcome.right),
        measured=count(of("measured"), lambda outcome: outcome.right),
        sure_of_wrong=count(of("single", "pair", "none", "outside", "number"), lambda outcome: outcome.sure_of_wrong),
        calibration=error and round(error.value, 3),
        cpu_median_s=round(float(np.median(cpu_s)), 2) if cpu_s else None,
        cpu_mean_s=round(float(np.mean(cpu_s)), 2) if cpu_s else None,
    )


def by_method(outcomes: Sequence[Outcome]) -> list[Figures]:
    """The figures of every method, in the order of its first answer."""
    names = list(dict.fromkeys(outcome.given.method for outcome in outcomes))
    return [figures(name, [outcome for outcome in outcomes if outcome.given.method == name]) for name in names]


def case_table(outcomes: Sequence[Outcome]) -> list[str]:
    """One line a case: set, kind, truth, and the answer of every method; + right, - wrong."""
    names = list(dict.fromkeys(outcome.given.method for outcome in outcomes))
    cases = {outcome.case.name: outcome.case for outcome in outcomes}
    answers = {(outcome.case.name, outcome.given.method): outcome.words for outcome in outcomes}
    lines = [f"{'case':27} {'kind':8} {'truth':46}" + "".join(f" {name:34}" for name in names)]
    for name, case in cases.items():
        faint = "" if case.visible else " (faint)"
        cells = "".join(f" {answers.get((name, method), ''):34.34}" for method in names)
        lines.append(f"{name:27.27} {case.kind:8} {case.truth + faint:46.46}{cells}".rstrip())
    return lines


def summary(title: str, rows: Sequence[Figures]) -> list[str]:
    """The figures as a text table."""
    head = ("first", "in three", "pairs F1", "alarms", "outside", "called out", "numbers", "measured", "sure wrong")
    lines = [f"{title:14}    n" + "".join(f" {name:>10}" for name in (*head, "calib.", "CPU s", "mean"))]
    for row in rows:
        cells: list[str] = []
        for value in row[2:]:
            if isinstance(value, tuple):
                cells.append(f"{value[0]} of {value[1]}" if value[1] else "")
            else:
                cells.append("" if value is None else f"{value:g}")
        lines.append(f"{row.method:14} {row.answered:4}" + "".join(f" {cell:>10}" for cell in cells))
    return lines
