"""All scores of one method over one opened set. Rates have Wilson's 95 % interval, all other scores the bootstrap's."""

import math
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

from bench.blind.calibration import Bin, calibration_error, error_of_perfect, judged, log_score, reliability
from bench.blind.intervals import Score, mean, rate, ratio
from bench.blind.locating import f1
from bench.blind.outcomes import OTHER_NAMES, Opened
from diagnosis.model.sensor_chain import SENSOR_EFFECTS

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


class Unclear(NamedTuple):
    """Scores of cases whose channels cannot separate a group of effects."""

    in_group: Score | None  # the true effect is in the named group
    group_told: Score | None  # the result gives two or more effects of the true group together
    experiment: Score | None  # the result proposes a run that would separate the leading explanations


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
    false_alarms_wide: Score | None  # false alarms of rigs drawn from wider tolerances than usual
    outside_caught: Score | None  # effect outside the library: "unexplained", or "partly" with less than half closed
    outside_caught_visible: Score | None  # the same for effects of 2 detection limits or more
    outside_named: Score | None  # effect outside the library, but the result names an effect
    sure_of_wrong_name: Score | None  # an effect that the rig lacks has p > 0.8; real logs do not count
    sure_of_wrong_answer: Score | None  # a wrong answer, "none" and "unexplained" included, has p > 0.8
    named_wrong: Score | None  # effects are named, and none of the true effects is in the group
    pair_f1: Score | None
    pair_exact: Score | None
    pair_one_right: Score | None
    unclear: Unclear
    real_logs: Singles  # sensor faults added to measured logs, whose gaps are unknown
    log_score: Score | None
    calibration_error: Score | None
    calibration_error_of_perfect: Score | None  # error of perfect probabilities by chance, for so many cases
    reliability: tuple[Bin, ...]
    sensor_or_physics: Score | None  # the named effect is of the right kind: sensor or rig
    locating_f1: Score | None
    shrinkage: Score | None  # mean share of the held-out gap that the named effects close
    shrinkage_of_oracle: Score | None
    interval_coverage: Score | None
    seconds: Score | None
    confusions: tuple[tuple[str, str, int], ...]  # wrong answers: truth, answer, number of cases


def score(cases: Sequence[Opened], oracle: Oracle) -> Scores:
    """Score a method; `oracle` gives the shrinkage of the true effects by case, and may be empty."""
    single = [case for case in cases if case.stratum == "one-effect"]
    no_gap = [case for case in cases if case.stratum == "no-gap"]
    outside = [case for case in cases if case.stratum == "outside"]
    pair = [case for case in cases if case.stratum == "two-effects"]
    unclear = [case for case in cases if case.stratum == "indistinguishable"]
    made = [case for case in cases if case.stratum != "real-log"]
    one_right = [case for case in made if case.right_candidate is not None]
    visible = [case for case in single if case.detectability >= _VISIBLE]
    pairs = judged(cases)
    named_one = [case for case in single if case.named]
    located = [f1(case) for case in (*single, *pair, *outside)]
    shrunk = [value for case in (*single, *pair) if (value := case.diagnosis["gap"].get("shrinkage")) is not None]
    seconds = [case.diagnosis["elapsed_s"] for case in cases if "elapsed_s" in case.diagnosis]
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
        false_alarms_wide=rate([case.verdict != "no-gap" for case in no_gap if case.answer["tolerances"] > 1.0]),
        outside_caught=rate([case.told_outside for case in outside]),
        outside_caught_visible=rate([case.told_outside for case in outside if case.detectability >= _VISIBLE]),
        outside_named=rate([bool(case.named) for case in outside]),
        sure_of_wrong_name=rate([_sure_of(case, effects_only=True) for case in made]),
        sure_of_wrong_answer=rate([_sure_of(case, effects_only=False) for case in one_right]),
        named_wrong=rate([bool(case.group) and not (case.truth & case.group) for case in one_right]),
        pair_f1=mean([case.set_f1 for case in pair]),
        pair_exact=rate([case.named == case.truth for case in pair]),
        pair_one_right=rate([bool(case.named & case.truth) for case in pair]),
        unclear=Unclear(
            rate([bool(case.truth & case.group) for case in unclear]),
            rate([len(case.group & set(case.answer["group"])) > 1 for case in unclear]),
            rate([case.diagnosis["next_experiment"].get("gain") is not None for case in unclear]),
        ),
        real_logs=of_singles([case for case in cases if case.stratum == "real-log"]),
        log_score=log_score(cases),
        calibration_error=calibration_error(pairs),
        calibration_error_of_perfect=error_of_perfect(pairs),
        reliability=tuple(reliability(pairs)),
        sensor_or_physics=rate([_class(case.named) == _class(case.truth) for case in named_one]),
        locating_f1=mean([value for value in located if value is not None]),
        shrinkage=mean(shrunk),
        shrinkage_of_oracle=_of_oracle(single, oracle),
        interval_coverage=_coverage(single, oracle),
        seconds=mean(seconds),
        confusions=_confusions(cases),
    )


def of_singles(cases: Sequence[Opened]) -> Singles:
    """The scores of cases with one effect of the library."""
    return Singles(
        alarm=rate([case.verdict in {"effect", "partly", "described", "unexplained"} for case in cases]),
        top_1=rate([frozenset(name for name, _ in case.ranked[:1]) == case.truth for case in cases]),
        top_3=rate([case.truth <= {name for name, _ in case.ranked[:3]} for case in cases]),
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


def _sure_of(case: Opened, effects_only: bool) -> bool:
    right = case.truth if effects_only else {case.right_candidate}
    return any(
        probability > _SURE and name not in right and not (effects_only and name in OTHER_NAMES)
        for name, probability in case.ranked
    )


def _class(names: frozenset[str]) -> frozenset[bool]:
    return frozenset(name in SENSOR_EFFECTS for name in names)


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
        right = (
            case.named == case.truth if case.answer["verdict"] == "effect" else case.verdict == case.answer["verdict"]
        )
        if case.stratum == "indistinguishable":
            right = bool(case.truth & case.group)
        if not right:
            counts[truth, answer] += 1
    return tuple((truth, answer, count) for (truth, answer), count in counts.most_common())
