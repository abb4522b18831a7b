"""From fits to a verdict: is there a gap, which effects close it, and how sure that is.

Fits compete by the logarithm of their evidence, Laplace's approximation: half of how far chi2 falls, less what the freedom of
their parameters costs. What comes from the differences is divided by the misfit that even the best model leaves, so that a
model that is wrong everywhere cannot be sure of anything (a quasi-likelihood), and by the jitter of the refits. `none` is the
rig refitted inside its tolerances. `unexplained` stands for a model that nobody wrote down and that leaves what a right model
leaves at most: it wins where the best of the library leaves more.
"""

import math
from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from diagnosis.fits.expected import MUCH, NEVER_WITHOUT_GAP, hidden_by_noise, much_left
from diagnosis.fits.fit import Fit
from diagnosis.fits.random_friction import LOAD, TRACK, RandomFriction, Scattered, is_random
from diagnosis.gap.measure import chi2_of
from diagnosis.verdict.probabilities import MISTAKEN_DOUBTFUL, mistaken_of, softmax, with_mistakes
from plant.effects.library import EFFECTS

Floats = npt.NDArray[np.floating[Any]]
_NO_ALARM = 1.0  # log evidence that `unexplained` stays behind `none` up to there
# and of what chi2 was above the expected: what a right effect's formula does not fit grows with it. Of an uneven drive one of 7
# limits left 0.10; of 12 effects outside the library the best single one left 0.35 to 0.98, but of a seal, which the runs kept
# aside tell. Two effects are freer: refitted from many starts, of 17 right pairs 14 left no more than 1.6 times the expected and
# the others up to 0.017 beyond; an amplifier that gives less above a knee, taken for gain and hardening, 0.026.
_MISMATCH_OF_ONE, _MISMATCH = 0.12, 0.012
# Proportions and a constant have no other formula: two right gains of 6 and 13 limits and a stiffness of 10 left 0.01 at most, an
# amplifier that gives less above a knee, taken for a gain, 0.09.
_EXACT = frozenset({"force-sensor-gain", "force-sensor-bias", "drive-stiffness"})
_COST_OF_UNKNOWN = 4.0  # log evidence: effects of the library are likelier than others
_REFUTED = 12.0  # log evidence by which `unexplained` is ahead of what the runs kept aside do not bear out
# Log evidence by which `unexplained` is ahead of a load that varies at random over time where friction comes in bursts, as debris
# does: what each of them scatters is alike.
_IN_BURSTS = 2.5
# log evidence below which a gap is no alarm: one effect of 26 in several forms always fits some noise. Of 30 evidences without a
# gap the most was 7.5 under an older floor, of 60 under this one 0.8; with an effect of 0.9 detection limits a wrong one had 3.
# Waves and bumps of the track of 2.3 and 3.7 limits have 11, and of 3.8 a load that varies narrow-band 4.
COST_OF_EFFECT = 8.0
# Refits end in valleys that differ by this much of chi2: slips come and go as parameters move. Priors do not.
JITTER = 1.5
_COST_OF_SECOND = 16.0  # on top, for a second effect,
_SECOND_CLOSES = 0.5  # which must also close this share of what the first leaves,
# and this share of what both close: less is what the first one's formula does not fit, unless it leaves much and both do not,
# or it has no other formula. Beside a gain of 13 limits a hardening of 1.7 added 0.022 and 35 of log evidence.
_SECOND_ADDS = 0.025
_UNDER_RANDOM = 2  # single effects that a random one is tried on top of


class RankedFit(NamedTuple):
    """A fit in the competition."""

    fit: Fit
    evidence: float  # log, against the refitted rig without effects
    scatters: bool = False  # friction varies at random in it


class Verdict(NamedTuple):
    """What came of the competition."""

    kind: Literal["effect", "no-gap", "unexplained"]
    named: Fit | None
    probabilities: dict[str, float]  # of every effect, none and unexplained; they add up to 1
    runner_up: Fit | None
    ranked: tuple[RankedFit, ...]  # single effects by evidence, the best first
    scale: float  # the misfit that all evidence is divided by
    refuted: tuple[str, ...] = ()  # effects that won, and that the runs kept aside do not bear out
    outside: bool = False  # something shows that is not compared, and that the library lacks


def _left_by_right(base: Fit, best: RankedFit, expected_chi2: float) -> float:
    """What a right explanation leaves at most; nothing more than the expected where noise hides the slips."""
    if hidden_by_noise(base, expected_chi2):
        return expected_chi2
    one = len(best.fit.hypothesis.effects) == 1 and not best.scatters and not _is_exact(best.fit)
    mismatch = _MISMATCH_OF_ONE if one else _MISMATCH
    return MUCH * expected_chi2 + mismatch * max(base.chi2 - expected_chi2, 0.0)


def _is_exact(fit: Fit) -> bool:
    """Whether an effect can have no other formula."""
    return _EXACT.issuperset(fit.hypothesis.effects)


def occam(fit: Fit) -> float:
    """Log evidence that the freedom of the effects' parameters costs."""
    if not fit.hypothesis.coordinates:
        return 0.0
    own = len(fit.deviations)
    _, volume = np.linalg.slogdet(fit.covariance()[own:, own:])
    return sum(math.log(axis.prior) for axis in fit.hypothesis.coordinates) - 0.5 * float(volume)


def judge(
    base: Fit,
    singles: list[Fit],
    pairs: list[Fit],
    expected_chi2: float,
    random: Sequence[RandomFriction] = (),
    refuted: bool = False,
) -> Verdict:
    """The verdict over single effects and pairs of them.

    Args:
        base: the rig without effects.
        singles, pairs: the best fit of each, best first.
        expected_chi2: of a perfect model.
        random: effects that vary at random, to be judged alone and on top of the best single effects.
        refuted: the runs kept aside do not bear out the effect that wins here.

    """
    alone, doubles, scale = _models(base, singles, pairs, expected_chi2, random)
    ranked = sorted(alone, key=lambda one: -one.evidence)
    double = max(doubles, key=lambda one: one.evidence, default=None)
    if double is not None and ranked and not _pays(double, ranked[0], base, expected_chi2):
        double = None
    best = double or (ranked[0] if ranked else None)
    scores = _of_no_effect(base, best, scale, expected_chi2) | _of_effects(ranked, double)
    top = max(scores, key=lambda name: scores[name])
    a_load = best is not None and best.scatters and best.fit.hypothesis.effects == (LOAD,) == (top,)
    behind = _REFUTED if refuted else _IN_BURSTS if a_load and any(one.in_bursts for one in random) else 0.0
    if behind > 0.0:
        scores["unexplained"] = scores[top] + behind
        top = "unexplained"
    leaders = best.fit.hypothesis.effects if best is not None and top in best.fit.hypothesis.effects else (top,)
    mistaken = mistaken_of(leaders, best is not None and best.scatters)
    probabilities = with_mistakes(softmax(scores), leaders, mistaken)
    if best is None or top == "none":
        return Verdict("no-gap", None, probabilities, ranked[0].fit if ranked else None, tuple(ranked), scale)
    followed = [one.fit for one in ranked if not is_random(one.fit.hypothesis)]  # no run separates a path from a path
    if top == "unexplained":
        nearest = followed[0] if followed and is_random(best.fit.hypothesis) else best.fit
        gone = best.fit.hypothesis.effects if refuted else ()
        return Verdict("unexplained", None, probabilities, nearest, tuple(ranked), scale, gone)
    others = [
        fit for fit in followed if fit is not best.fit and fit.hypothesis.effects[0] not in best.fit.hypothesis.effects
    ]
    runner_up = others[0] if others else None
    return Verdict("effect", best.fit, probabilities, runner_up, tuple(ranked), scale)


def _models(
    base: Fit, singles: list[Fit], pairs: list[Fit], expected_chi2: float, random: Sequence[RandomFriction]
) -> tuple[list[RankedFit], list[RankedFit], float]:
    """Single effects and pairs with their evidence, and the misfit that it is divided by."""

    def scattered(noise: float) -> list[tuple[Fit, str, Scattered]]:
        """What lies under a random effect, the effect, and both."""
        found: list[tuple[Fit, str, Scattered]] = []
        for effect in random:
            others = [one for one in singles if effect.effect not in one.hypothesis.effects][:_UNDER_RANDOM]
            # a track is more than the two waves of its form: what they leave was named as a load beside it
            own = [one for one in singles[:_UNDER_RANDOM] if effect.effect in one.hypothesis.effects]
            found += [(fit, effect.effect, effect.on(fit, noise)) for fit in (base, *others, *own)]
        return found

    closest = scattered(JITTER)
    fits = [base, *singles, *pairs, *(one.fit for *_, one in closest)]
    scale = max(min(fit.chi2 for fit in fits) / expected_chi2, 1.0)

    def model(fit: Fit) -> RankedFit:
        closer = chi2_of(base.residual) - chi2_of(fit.residual)
        likelier = (base.chi2 - fit.chi2) - closer
        return RankedFit(fit, 0.5 * closer / (scale * JITTER) + 0.5 * likelier - occam(fit))

    alone = [model(fit) for fit in singles]
    doubles = [model(fit) for fit in pairs]
    for (under, effect, both), (*_, close) in zip(scattered(scale * JITTER), closest, strict=True):
        if close.fit.chi2 > NEVER_WITHOUT_GAP * expected_chi2:
            continue  # so free a path leaves no more if it is the cause; a plug that came loose left 4.5 times the expected
        if under is base:
            alone.append(RankedFit(both.fit, both.gained, scatters=True))
        elif effect in under.hypothesis.effects:
            if both.gained > 0.0:
                alone = [one for one in alone if one.fit is not under]
                wave = under._replace(chi2=both.fit.chi2)
                alone.append(RankedFit(wave, model(under).evidence + both.gained, scatters=True))
        else:
            doubles.append(RankedFit(both.fit, model(under).evidence + both.gained, scatters=True))
    return alone, doubles, scale


def _pays(double: RankedFit, first: RankedFit, base: Fit, expected_chi2: float) -> bool:
    """Whether a second effect is worth naming beside the best single one."""
    taken = first.fit.chi2 - double.fit.chi2
    closed = taken / max(first.fit.chi2 - expected_chi2, 1.0)
    adds = taken / max(base.chi2 - double.fit.chi2, 1.0)
    completes = much_left(first.fit, expected_chi2) and not much_left(double.fit, expected_chi2)
    # a path leaves little of anything: beside friction that differs by direction, at 208 of 90 expected, a track was named
    needless = double.scatters and first.fit.chi2 <= _left_by_right(base, first, expected_chi2)
    is_mismatch = adds < _SECOND_ADDS and not completes and not _is_exact(first.fit)
    gained = double.evidence - first.evidence
    return gained >= _COST_OF_SECOND and closed >= _SECOND_CLOSES and not is_mismatch and not needless


def _of_no_effect(base: Fit, best: RankedFit | None, scale: float, expected_chi2: float) -> dict[str, float]:
    """Log evidence of `none` and `unexplained`."""
    certain = max(base.chi2 - NEVER_WITHOUT_GAP * expected_chi2, 0.0)
    against_none = 0.5 * certain / JITTER
    none = COST_OF_EFFECT - against_none
    unknown = 0.5 * (base.chi2 - expected_chi2) / (scale * JITTER)
    if best is not None:  # what nobody wrote down would pay as much for its freedom as the best that somebody did
        unknown = best.evidence + 0.5 * (best.fit.chi2 - _left_by_right(base, best, expected_chi2)) / (scale * JITTER)
    unknown -= _COST_OF_UNKNOWN
    if against_none > 0.0:
        return {"none": none, "unexplained": max(unknown, min(against_none, COST_OF_EFFECT))}
    return {"none": none, "unexplained": min(unknown, none - _NO_ALARM)}


def _of_effects(ranked: list[RankedFit], double: RankedFit | None) -> dict[str, float]:
    """Log evidence of every effect of the library."""
    alone = {
        one.fit.hypothesis.effects[0]: one.evidence for one in reversed(ranked)
    }  # the better one of two forms last
    scores: dict[str, float] = {}
    if double is not None:  # both as probable, so the stronger one first
        for name in sorted(double.fit.hypothesis.effects, key=lambda name: -alone.get(name, -math.inf)):
            scores[name] = double.evidence - math.log(2.0)
    for name in (*alone, *EFFECTS):
        scores.setdefault(name, alone.get(name, -30.0))
    return scores


def is_of_one_place(fit: Fit) -> bool:
    """Whether a fit is waves of the track alone: elsewhere it may have others."""
    return fit.hypothesis.effects == (TRACK,) and not is_random(fit.hypothesis)


def of_another_place(
    base: Fit, singles: list[Fit], expected_chi2: float, random: Sequence[RandomFriction]
) -> Verdict | None:
    """The verdict without the track's waves, which another run refutes, if that is friction that varies at random.

    A track of three waves, told by two of them, left 3.98 of 5.63 floors of a run elsewhere; what it scatters closes 0.61.
    """
    verdict = judge(base, [fit for fit in singles if not is_of_one_place(fit)], [], expected_chi2, random)
    return verdict if verdict.named is not None and is_random(verdict.named.hypothesis) else None


def refittable(verdict: Verdict) -> bool:
    """Whether a single effect was named that a prediction can follow."""
    named = verdict.named
    return named is not None and len(named.hypothesis.effects) == 1 and not is_random(named.hypothesis)


def doubted(verdict: Verdict) -> Verdict:
    """The same name, less sure of it: it leaves more of the runs kept aside than right ones do."""
    assert verdict.named is not None, "nothing is named"  # noqa: S101
    leaders = verdict.named.hypothesis.effects
    return verdict._replace(probabilities=with_mistakes(verdict.probabilities, leaders, MISTAKEN_DOUBTFUL))


def although_outside(verdict: Verdict, imitators: frozenset[str] = frozenset()) -> Verdict:
    """The verdict where something shows that no fit looks at, and that no effect of the library makes.

    That is never "no gap", nor what would imitate it alone.
    """
    named = verdict.named
    if verdict.kind == "no-gap":
        won = "none"
    elif named is not None and imitators.issuperset(named.hypothesis.effects):
        won = named.hypothesis.effects[0]
    else:
        return verdict
    swapped = {won: verdict.probabilities["unexplained"], "unexplained": verdict.probabilities[won]}
    probabilities = dict(sorted((verdict.probabilities | swapped).items(), key=lambda item: -item[1]))
    return verdict._replace(
        kind="unexplained", named=None, runner_up=named or verdict.runner_up, probabilities=probabilities, outside=True
    )
