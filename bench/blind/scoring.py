"""All scores of one method over one opened set. Rates have Wilson's 95 % interval, all other scores the bootstrap's."""

import math
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from bench.blind.calibration import Bin, calibration_error, error_of_perfect, judged, reliability
from bench.blind.intervals import Score, bootstrapped, mean, rate, ratio
from bench.blind.locating import f1
from bench.blind.outcomes import Opened

_SURE = 0.8  # probability above which an answer counts as sure
_VISIBLE = 2.0  # detection limits from which an effect counts as visible
_DETECTABILITIES = (0.0, 1.0, 2.0, 4.0, math.inf)  # limits of the groups by size, in detection limits
# Shrinkage of the oracle below which a case is not compared with it. Smaller: the ratio is noise. Larger: fewer cases.
_LEAST_SHRINKAGE = 0.1

Oracle = dict[str, float | None]  # share of the held-out gap that the true effects close, by case


class Singles(NamedTuple):
    """Scores of cases with one effect of the library."""

    alarm: Score | None  # the verdict is effect, partly, described or unexplained
    top_1: Score | None  # the true effect is the first candidate
    top_3: Score | None  # the true effect is among the first three candidates
    in_group: Score | None  # the true effect is in the named group
    group_size: Score | None  # mean size of the group where an effect is named
    wrong: Score | None  # an effect is named, and the true effect is not in its group


class Scores(NamedTuple):
    """All scores of one method."""

    cases: int
    faults: int
    visible: Singles  # cases with one effect of 2 detection limits or more
    singles: Singles
    by_detectability: dict[str, Singles]
    by_effect: dict[str, Singles]
    by_backbone: dict[str, Singles]
    false_alarms: Score | None
    pair_f1: Score | None
    outside_caught: Score | None  # effect outside the library: "unexplained", or the named effects close less than half
    number_named: Score | None  # wrong number of the description: "described", with this number
    number_right: Score | None  # the same, and its value is within 2 % of the true one
    sure_of_wrong_name: Score | None  # an effect that the rig lacks has p > 0.8; rigs without a gap do not count
    calibration_error: Score | None
    calibration_error_of_perfect: Score | None  # error of perfect probabilities by chance, for so many cases
    reliability: tuple[Bin, ...]
    locating_f1: Score | None
    shrinkage: Score | None  # mean share of the held-out gap that the named effects close
    shrinkage_of_oracle: Score | None
    interval_coverage: Score | None
    cpu_median_s: Score | None
    cpu_95_s: Score | None  # 95 % of the cases need less
    confusions: tuple[tuple[str, str, int], ...]  # wrong answers: truth, answer, number of cases


def score(cases: Sequence[Opened], oracle: Oracle) -> Scores:
    """Score a method; `oracle` gives the shrinkage of the true effects by case, and may be empty."""
    single = [case for case in cases if case.stratum == "one-effect"]
    no_gap = [case for case in cases if case.stratum == "no-gap"]
    outside = [case for case in cases if case.stratum == "outside"]
    pair = [case for case in cases if case.stratum == "two-effects"]
    number = [case for case in cases if case.stratum == "wrong-number"]
    visible = [case for case in single if case.detectability >= _VISIBLE]
    pairs = judged(cases)
    located = [f1(case) for case in (*single, *pair, *outside)]
    shrunk = [value for case in (*single, *pair) if (value := case.diagnosis["gap"].get("shrinkage")) is not None]
    cpu_s = [case.diagnosis["cpu_s"] for case in cases if case.diagnosis.get("cpu_s") is not None]
    return Scores(
        cases=len(cases),
        faults=sum(case.verdict == "fault" for case in cases),
        visible=of_singles(visible),
        singles=of_singles(single),
        by_detectability=_by_detectability(single),
        by_effect={
            name: of_singles([case for case in single if name in case.truth])
            for name in sorted({name for case in single for name in case.truth})
        },
        by_backbone={
            name: of_singles([case for case in visible if case.answer["backbone"] == name])
            for name in sorted({case.answer["backbone"] for case in visible if case.answer["backbone"]})
        },
        false_alarms=rate([case.verdict != "no-gap" for case in no_gap]),
        pair_f1=mean([case.set_f1 for case in pair]),
        outside_caught=rate([case.told_outside for case in outside]),
        number_named=rate([case.number_named for case in number]),
        number_right=rate([case.number_right for case in number]),
        sure_of_wrong_name=rate([_sure_of_wrong_name(case) for case in (*single, *pair, *outside, *number)]),
        calibration_error=calibration_error(pairs),
        calibration_error_of_perfect=error_of_perfect(pairs),
        reliability=tuple(reliability(pairs)),
        locating_f1=mean([value for value in located if value is not None]),
        shrinkage=mean(shrunk),
        shrinkage_of_oracle=_of_oracle(single, oracle),
        interval_coverage=_coverage(single, oracle),
        cpu_median_s=bootstrapped(cpu_s, lambda sample: float(np.median(sample))),
        cpu_95_s=bootstrapped(cpu_s, lambda sample: float(np.quantile(sample, 0.95))),
        confusions=_confusions(cases),
    )


def of_singles(cases: Sequence[Opened]) -> Singles:
    """The scores of cases with one effect of the library."""
    return Singles(
        alarm=rate([case.verdict in {"effect", "partly", "described", "unexplained"} for case in cases]),
        top_1=rate([case.truth == frozenset(case.leading[:1]) for case in cases]),
        top_3=rate([case.truth <= set(case.leading[:3]) for case in cases]),
        in_group=rate([case.truth <= case.group for case in cases]),
        group_size=mean([float(len(case.group)) for case in cases if case.named]),
        wrong=rate([bool(case.group) and not case.truth <= case.group for case in cases]),
    )


def _by_detectability(cases: Sequence[Opened]) -> dict[str, Singles]:
    by_size: dict[str, Singles] = {}
    for low, high in pairwise(_DETECTABILITIES):
        within = [case for case in cases if low <= case.detectability < high]
        if within:
            by_size[f"{low:g} to {high:g}" if math.isfinite(high) else f"{low:g} and more"] = of_singles(within)
    return by_size


def _sure_of_wrong_name(case: Opened) -> bool:
    return any(p > _SURE and name not in {*case.truth, "none", "unexplained"} for name, p in case.ranked)


def _of_oracle(cases: Sequence[Opened], oracle: Oracle) -> Score | None:
    """Shrinkage of the named effects over shrinkage of the true effects; a result without a name counts as 0."""
    return ratio(
        [
            (case.diagnosis["gap"].get("shrinkage") or 0.0, best)
            for case in cases
            if (best := oracle.get(case.name)) is not None and best > _LEAST_SHRINKAGE
        ]
    )


def _coverage(cases: Sequence[Opened], oracle: Oracle) -> Score | None:
    """How often the 90 % interval of the shrinkage holds the shrinkage of the true effect.

    Parameters cannot be compared, as the true formula differs from the library's.
    """
    held: list[bool] = []
    for case in cases:
        interval, best = case.diagnosis["gap"].get("interval_90"), oracle.get(case.name)
        if interval is not None and best is not None:
            held.append(interval[0] <= best <= interval[1])
    return rate(held)


def _confusions(cases: Sequence[Opened]) -> tuple[tuple[str, str, int], ...]:
    counts: Counter[tuple[str, str]] = Counter()
    for case in cases:
        answer = "+".join(sorted(case.named)) or case.verdict
        truth = "+".join(sorted(case.truth)) or "no-gap"
        right = case.verdict == case.answer["verdict"]
        if case.stratum == "wrong-number":
            right = case.number_named
        elif case.answer["verdict"] == "effect":
            right = case.named == case.truth
        if not right:
            counts[truth, answer] += 1
    return tuple((truth, answer, count) for (truth, answer), count in counts.most_common())
