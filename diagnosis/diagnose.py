"""The whole way from an evidence to a diagnosis: retune, alarm, name, group, judge on held-out runs, say what to do next."""

import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from diagnosis.assembling import assembled
from diagnosis.evidence import Evidence
from diagnosis.form import NOTHING, Form
from diagnosis.gap import KNEE
from diagnosis.heldout import MORE_THAN_RIGHT, HeldOut
from diagnosis.late_friction import EFFECT as LAG
from diagnosis.late_friction import late_fits
from diagnosis.library import trials
from diagnosis.phases_by_run import starts_by_run
from diagnosis.problem import Problem, prepare
from diagnosis.random_friction import RANDOM_EFFECTS, RandomFriction
from diagnosis.refit import FAR_KNEE, Fit, Fitter
from diagnosis.result import Diagnosis
from diagnosis.retuning import Retuned, retuned_rig
from diagnosis.search import (
    Origin,
    Start,
    best_of_each,
    each_beside,
    middle_fits,
    pairs_of_effects,
    pairs_with,
    refits,
    refitted,
    refitted_rest,
    screened,
)
from diagnosis.second_floor import on_floor_of
from diagnosis.verdict import (
    COST_OF_EFFECT,
    NEVER_WITHOUT_GAP,
    Verdict,
    although_outside,
    doubted,
    hidden_by_noise,
    is_of_one_place,
    judge,
    much_left,
    of_another_place,
    refittable,
)
from diagnosis.workers import one_thread

Floats = npt.NDArray[np.floating[Any]]
Progress = Callable[[str, float], None]
# log evidence from which a name is not checked: a guess, as the one check seen to overturn a name took 8 to -7
_SURE = COST_OF_EFFECT + 14.0
_CHECKS = 3  # names that may fall one after the other
_LEADING = 2  # fits that are refitted further: one that was not had a second effect named for what it left
_CONTENDERS, _CONTENDS = 3, 0.3  # single effects, if they close this share of what the best one closes,
_RIVALS = 0.9  # this one where two effects explain what none does alone
_RIVAL_PAIRS = 0.7  # of what the best pair takes beyond the best single effect
# Of what is above the expected: a path that varies at random has a strongest wave. Two that were drawn had one of 38 and 64 %, a
# load whose wave began anew in every run one of 7.7 %; a clock that ran fast, a coupling that slipped and a loose plug, which a
# path that free would take for scatter, 1 to 3 %.
_STRONGEST_WAVE = 0.05
# Times the expected chi2: right effects whose formula is another leave up to 2.5 (but one, seen by the force alone, 28), a gain
# of the force sensor that stood for a Coulomb friction never tried left 5.5. What is searched then takes as long as all before.
_DOUBTFUL = 3.0
# Times the first number of an effect that comes near and leaves much. Where slips come and go chi2 is rough: a force late by
# 1.75 ms had ended at 368, beside a slow sensor at 237; from these sizes it came to 205 (`stickslip diagnose --json`).
_SIZES_BESIDE = (0.85, 1.15)
_NEAR = 0.6  # of the gap: of 11 effects outside the library the best single one closed 0.08 to 0.42
_WORTH_MORE = 40.0  # of chi2 that the best single effect takes: of two that show, one takes more


def diagnose(evidence: Evidence, progress: Progress, jobs: int = 1) -> Diagnosis:
    """Diagnose one evidence. `progress` is told, in words, what is known and the share of the work that is done.

    The answer does not depend on `jobs`. Raises Fault BAD_EVIDENCE when nothing can be compared.
    """
    with one_thread():
        return _diagnosed(evidence, progress, jobs)


def _diagnosed(evidence: Evidence, progress: Progress, jobs: int) -> Diagnosis:
    began = time.monotonic()
    runs = prepare(evidence)
    fitted = [run for run in runs if not run.holdout]
    problem = Problem(evidence.rig, fitted)
    fitter, retuned, roughness, expected_chi2 = retuned_rig(evidence, problem, progress, jobs)
    described = np.zeros(len(fitter.nuisances))
    tried = trials(problem)
    origins = [Origin(retuned, KNEE)]
    if much_left(retuned, expected_chi2):  # a large effect may have pulled the refit into a valley of its own
        origins.append(Origin(fitter.described(described), FAR_KNEE))
    found = screened(fitter, origins, tried, jobs)
    singles = _finished(fitter, refitted(fitter, origins, found, jobs), expected_chi2, jobs)
    pairs: list[Fit] = []
    if singles and retuned.chi2 - singles[0].chi2 > _WORTH_MORE and singles[0].chi2 > expected_chi2:
        progress(f"best single effect so far: {singles[0].form.effects[0]}; looking for a second", 0.6)
        pairs = pairs_of_effects(fitter, retuned, singles, tried, expected_chi2, jobs)
        if pairs and much_left(pairs[0], expected_chi2):
            pairs = _finished(fitter, pairs, expected_chi2, jobs)
        singles = _again(fitter, singles, _alone(pairs), jobs)
    if singles:  # an effect must not win because its refit found a valley of the nuisances that the retuning had missed
        again = fitter.refit(NOTHING, singles[0].deviations, np.zeros(0))
        retuned = min(retuned, again, key=lambda fit: fit.chi2)
    if singles and retuned.chi2 - singles[0].chi2 > _WORTH_MORE:
        contenders = _contenders(retuned, singles, pairs, expected_chi2)
        near = _is_near(singles[0], retuned, expected_chi2) and much_left(singles[0], expected_chi2)
        sizes = _SIZES_BESIDE if near else ()
        singles = _again(fitter, singles, _starts_of_contenders(retuned, contenders, sizes), jobs)
        singles = _finished(fitter, singles, expected_chi2, jobs)
    verdict = judge(retuned, singles, pairs, expected_chi2)
    if verdict.named is not None and len(verdict.named.form.effects) > 1:
        starts = _starts_of_contenders(retuned, _rival_pairs(singles, pairs), ())
        pairs = _finished(fitter, _again(fitter, pairs, starts, jobs), expected_chi2, jobs)
        verdict = judge(retuned, singles, pairs, expected_chi2)
    if verdict.kind == "unexplained" or (verdict.named is not None and verdict.named.chi2 > _DOUBTFUL * expected_chi2):
        progress("nothing explains it well yet: every effect gets a refit", 0.65)
        singles = _with(singles, refitted_rest(fitter, origins, found, tried, jobs))
        if _varies(retuned, singles, expected_chi2):
            by_run = starts_by_run(fitter, retuned, tried, jobs)
            singles = _finished(fitter, _again(fitter, singles, by_run, jobs), expected_chi2, jobs)
        if any(fit.form.effects == (LAG,) for fit in _close(retuned, singles)):
            singles = _finished(fitter, _with(singles, late_fits(fitter, tried, jobs)), expected_chi2, jobs)
        if singles and much_left(singles[0], expected_chi2):
            progress(f"every effect gets a refit beside the best one, {singles[0].form.effects[0]}", 0.7)
            best_before = pairs[0].chi2 if pairs else math.inf
            pairs = _finished(fitter, _with(pairs, pairs_with(fitter, singles[0], tried, jobs)), expected_chi2, jobs)
            if pairs and pairs[0].chi2 < best_before:
                singles = _again(fitter, singles, _alone(pairs), jobs)
        verdict = judge(retuned, singles, pairs, expected_chi2)
    random: list[RandomFriction] = []
    if _may_scatter(verdict, retuned, singles, pairs, expected_chi2):
        progress("could what is left be friction that varies at random?", 0.75)
        random = [_random(effect, fitter, retuned, singles) for effect in RANDOM_EFFECTS]
        verdict = judge(retuned, singles, pairs, expected_chi2, random)
    if refittable(verdict) and verdict.named is not None and much_left(verdict.named, expected_chi2):
        # among all others few of its starts had a place: a lag was refuted at chi2 213, alone it came to 161
        own = [trial for trial in tried if trial.form.effects == verdict.named.form.effects]
        again = refitted(fitter, origins, screened(fitter, origins, own, jobs), jobs)
        singles = _finished(fitter, _with(singles, again), expected_chi2, jobs)
        verdict = judge(retuned, singles, pairs, expected_chi2, random)
    first = Retuned(fitter, retuned, roughness, expected_chi2)
    singles, verdict = _checked(first, singles, random, verdict, jobs)
    nearest = _nearest(retuned, singles, pairs, expected_chi2)
    if verdict.kind == "unexplained" and nearest is not None:
        progress(
            "nothing explains it on the floors of the rig without effects: once more on those of the nearest model",
            0.77,
        )
        second, alone, together = on_floor_of(nearest, first, singles, pairs, jobs)
        again = judge(second.fit, alone, together, second.expected_chi2)
        alone, again = _checked(second, alone, [], again, jobs)
        if again.named is not None:
            (fitter, retuned, _, expected_chi2), singles, pairs = second, alone, together
            random, verdict = [], again
    best = verdict.named or retuned
    unseen = [run for run in runs if run.holdout]
    held_out: HeldOut | None = None
    gone: Fit | None = None  # what won, and is refuted
    if unseen:
        problem = Problem(evidence.rig, unseen)
        expected = expected_chi2 / len(retuned.residual)
        held_out = HeldOut(problem, fitter.nuisances, best, retuned, roughness, jobs)
        if verdict.named is not None and held_out.refutes(best, expected):
            gone, best = best, retuned
            verdict_there = None
            if is_of_one_place(gone):
                paths = random or [_random(effect, fitter, retuned, singles) for effect in RANDOM_EFFECTS]
                verdict_there = of_another_place(retuned, singles, expected_chi2, paths)
            verdict = judge(retuned, singles, pairs, expected_chi2, random, refuted=True)
            if verdict_there is not None and verdict_there.named is not None:
                there = HeldOut(problem, fitter.nuisances, verdict_there.named, retuned, roughness, jobs)
                if not there.refutes(verdict_there.named, expected):
                    gone, best, verdict, held_out = None, verdict_there.named, verdict_there, there
        if verdict.named is not None and held_out.left_by(best) > MORE_THAN_RIGHT:
            verdict = doubted(verdict)
    if any(run.pick_up for run in evidence.runs):
        verdict = although_outside(verdict)
    progress(f"verdict: {verdict.kind}", 0.8)
    return assembled(evidence, runs, fitter, retuned, best, gone, singles, verdict, tried, held_out, began, jobs)


def _checked(
    rig: Retuned, singles: list[Fit], random: list[RandomFriction], verdict: Verdict, jobs: int
) -> tuple[list[Fit], Verdict]:
    """Single effects and the verdict, in which a name of little evidence stands up to the middle of several refits.

    One that does not is set back to its middle fit, and the next one is looked at.
    """
    for _ in range(_CHECKS):
        if not refittable(verdict) or verdict.ranked[0].evidence >= _SURE:
            break
        without, middle = middle_fits(rig.fitter, rig.fit, singles, verdict.ranked[0].fit, jobs)
        if judge(without, [middle], [], rig.expected_chi2).named is not None:
            break
        others = [fit for fit in singles if fit.form.effects != middle.form.effects]
        singles = sorted((middle, *others), key=lambda fit: fit.chi2)
        verdict = judge(rig.fit, singles, [], rig.expected_chi2, random)
    return singles, verdict


def _may_scatter(verdict: Verdict, retuned: Fit, singles: list[Fit], pairs: list[Fit], expected_chi2: float) -> bool:
    """Whether what is left may be friction that varies at random: rigs without a gap leave scatter too."""
    if retuned.chi2 <= NEVER_WITHOUT_GAP * expected_chi2:
        return False
    if hidden_by_noise(retuned, expected_chi2):
        return False
    if not _varies(retuned, singles, expected_chi2):
        return False
    left = min(fit.chi2 for fit in (retuned, *singles, *pairs))
    return verdict.kind == "unexplained" or left > NEVER_WITHOUT_GAP * expected_chi2


def _varies(retuned: Fit, singles: list[Fit], expected_chi2: float) -> bool:
    """Whether a wave of the friction, over time or along the track, takes a share of the gap."""
    waves = [fit.chi2 for fit in singles if fit.form.effects[0] in RANDOM_EFFECTS]
    return retuned.chi2 - min(waves, default=math.inf) >= _STRONGEST_WAVE * (retuned.chi2 - expected_chi2)


def _nearest(retuned: Fit, singles: list[Fit], pairs: list[Fit], expected_chi2: float) -> Fit | None:
    """The model that leaves least, if it comes near."""
    found = min((*singles[:1], *pairs[:1]), key=lambda fit: fit.chi2, default=retuned)
    return found if _is_near(found, retuned, expected_chi2) else None


def _is_near(fit: Fit, retuned: Fit, expected_chi2: float) -> bool:
    """Whether a model closes so much that the measured rig is like it."""
    return retuned.chi2 - fit.chi2 > _NEAR * (retuned.chi2 - expected_chi2) > 0.0


def _random(effect: str, fitter: Fitter, retuned: Fit, singles: list[Fit]) -> RandomFriction:
    """The random form of an effect on the rig that comes nearest without that effect."""
    others = [retuned, *(fit for fit in singles if effect not in fit.form.effects)]
    return RandomFriction(effect, fitter, min(others, key=lambda fit: fit.chi2))


def _finished(fitter: Fitter, fits: list[Fit], expected_chi2: float, jobs: int) -> list[Fit]:
    """The fits, best first, the leading ones refitted as long as that gains where they leave much."""
    leading = [fit for fit in fits[:_LEADING] if much_left(fit, expected_chi2) and not fit.finished]
    return _with(fits, each_beside(jobs, Fitter.going_further, fitter, leading))


def _alone(pairs: list[Fit]) -> list[Start]:
    """Each effect of the best pair alone, from where the pair left it."""
    if not pairs:
        return []
    best = min(pairs, key=lambda fit: fit.chi2)
    starts: list[Start] = []
    for name, form in best.form.forms.items():
        own = [i for i, axis in enumerate(best.form.axes) if axis.effect == name]
        starts.append((Form({name: form}, tuple(best.form.axes[i] for i in own)), best.deviations, best.w[own]))
    return starts


def _contenders(retuned: Fit, singles: list[Fit], pairs: list[Fit], expected_chi2: float) -> list[Fit]:
    """The leading single effects; where only two explain the gap, the best one if it is of the two, and its rivals."""
    if not pairs or much_left(pairs[0], expected_chi2) or not much_left(singles[0], expected_chi2):
        return singles[:_CONTENDERS]
    rivals = [fit for fit in _close(retuned, singles, _RIVALS)[:_CONTENDERS] if fit is not singles[0]]
    return [fit for fit in singles[:1] if rivals or fit.form.effects[0] in pairs[0].form.effects] + rivals


def _rival_pairs(singles: list[Fit], pairs: list[Fit]) -> list[Fit]:
    """The best pairs, if they take nearly as much more than the best single effect does.

    Beside a base of 11 detection limits a Stribeck velocity had ended at chi2 331, friction that lags at 255 and was named; from
    the described rig, from the retuned one and from the lag's nuisances it came to 179 to 188, the lag to no less.
    """
    return [
        pair
        for pair in pairs[:_CONTENDERS]
        if singles[0].chi2 - pair.chi2 > _RIVAL_PAIRS * (singles[0].chi2 - pairs[0].chi2)
    ]


def _starts_of_contenders(retuned: Fit, contenders: list[Fit], sizes: tuple[float, ...]) -> list[Start]:
    """The contenders from the described rig, from the retuned one and from the best one's nuisances, and that one from theirs.

    From the first two also with `sizes` times their first number.

    A lag was named at chi2 155, as the static friction that it was had ended at 235: from the described rig and from the lag's
    nuisances it came to 143. A roll-off at 481 got a second effect; from the retuned rig it came to 245, refitted further to 117.
    """
    if not contenders:
        return []
    best, *close = _close(retuned, contenders)
    nuisances = (np.zeros_like(retuned.deviations), retuned.deviations)
    starts = [
        (fit.form, deviations, w)
        for fit in (best, *close)
        for deviations in nuisances
        for w in (fit.w, *(_resized(fit, size) for size in sizes))
    ]
    return starts + [(one.form, other.deviations, one.w) for fit in close for one, other in ((fit, best), (best, fit))]


def _resized(fit: Fit, size: float) -> Floats:
    w = fit.w.copy()
    w[0] = w[0] + math.log(size) if fit.form.axes[0].logarithmic else w[0] * size
    return w


def _close(retuned: Fit, fits: list[Fit], share: float = _CONTENDS) -> list[Fit]:
    """The fits, best first, that close more than this share of what the best one closes."""
    return [fit for fit in fits if retuned.chi2 - fit.chi2 > share * (retuned.chi2 - fits[0].chi2)]


def _again(fitter: Fitter, fits: list[Fit], starts: list[Start], jobs: int) -> list[Fit]:
    """Single effects, or pairs, best first, after refits from other starts."""
    return _with(fits, refits(fitter, starts, jobs))


def _with(fits: list[Fit], more: list[Fit]) -> list[Fit]:
    """All of them, best first; of two as good the one of `more`, which may be marked as finished."""
    return best_of_each(sorted((*more, *fits), key=lambda fit: fit.chi2))
