"""From fits to a verdict: is there a gap, which effects close it, and how sure that is.

Fits compete by the logarithm of their evidence, in Laplace's approximation: half the fall of chi2, less a cost for the freedom
of their parameters. The part of the fall that comes from the differences is divided by the misfit that even the best model
leaves, so that a model that is wrong everywhere is sure of nothing (a quasi-likelihood), and by the jitter of the refits.
`none` is the baseline. `unexplained` stands for a model outside the library that leaves as much as a right model leaves at
most: it wins where the best fit of the library leaves more. Case histories: docs/method/diagnosis.md.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from diagnosis.fits.expected import MUCH, NEVER_WITHOUT_GAP, hidden_by_noise, much_left
from diagnosis.fits.fit import Fit
from diagnosis.fits.random_friction import LOAD, TRACK, RandomFriction, Scattered, is_random
from diagnosis.gap.measure import chi2_of
from diagnosis.result import Kind
from diagnosis.verdict.probabilities import MISTAKEN_DOUBTFUL, mistaken_of, softmax, swapped, with_mistakes
from plant.effects.library import EFFECTS

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
_REFUTED = 12.0  # log evidence by which `unexplained` is ahead of what the held-out runs do not bear out
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
    """A fit with its log evidence."""

    fit: Fit
    evidence: float  # natural logarithm, against the baseline
    scatters: bool = False  # whether friction varies at random in the fit


class Verdict(NamedTuple):
    """The answer of one judgement over fits."""

    kind: Kind
    named: Fit | None  # None unless `kind` is "effect" or "partly"; None there where no fit has what is named
    probabilities: dict[str, float]  # of every effect, "none" and "unexplained", largest first; they add up to 1
    runner_up: Fit | None
    ranked: tuple[RankedFit, ...]  # single effects, the largest evidence first
    scale: float  # the misfit that all evidence is divided by, at least 1
    refuted: tuple[str, ...] = ()  # effects that won, and that the held-out runs do not confirm
    outside: bool = False  # whether the runs show a vibration that no feature compares and no effect makes
    by_relations: tuple[str, ...] = ()  # names that the relations decide, where they are not those of `named`

    @property
    def names(self) -> tuple[str, ...]:
        """The named effects."""
        return self.by_relations or (() if self.named is None else self.named.hypothesis.effects)


def _left_by_right(baseline: Fit, best: RankedFit, expected_chi2: float) -> float:
    """The largest chi2 that a right explanation leaves; the expected chi2 where noise hides the slips."""
    if hidden_by_noise(baseline, expected_chi2):
        return expected_chi2
    single = len(best.fit.hypothesis.effects) == 1 and not best.scatters and not _is_exact(best.fit)
    mismatch = _MISMATCH_OF_ONE if single else _MISMATCH
    return MUCH * expected_chi2 + mismatch * max(baseline.chi2 - expected_chi2, 0.0)


def _is_exact(fit: Fit) -> bool:
    """Whether all effects of a fit have only one possible formula."""
    return _EXACT.issuperset(fit.hypothesis.effects)


def occam(fit: Fit) -> float:
    """The log evidence that the freedom of the effects' coordinates costs; 0 for a fit without effects."""
    if not fit.hypothesis.coordinates:
        return 0.0
    nuisances = len(fit.deviations)
    _, volume = np.linalg.slogdet(fit.covariance()[nuisances:, nuisances:])
    return sum(math.log(coordinate.prior) for coordinate in fit.hypothesis.coordinates) - 0.5 * float(volume)


def judge(
    baseline: Fit,
    singles: list[Fit],
    pairs: list[Fit],
    expected_chi2: float,
    random: Sequence[RandomFriction] = (),
    refuted: bool = False,
) -> Verdict:
    """The verdict over single effects and pairs of effects.

    Args:
        baseline: the rig without effects, refitted within its tolerances.
        singles, pairs: the best fit of every single effect and of every pair, the lowest chi2 first.
        expected_chi2: chi2 of a perfect model.
        random: effects that vary at random; each is judged alone and on top of the best single effects.
        refuted: whether the held-out runs refute the effect that wins here.

    """
    alone, doubles, scale = _models(baseline, singles, pairs, expected_chi2, random)
    ranked = sorted(alone, key=lambda ranked_fit: -ranked_fit.evidence)
    double = max(doubles, key=lambda double: double.evidence, default=None)
    if double is not None and ranked and not _pays(double, ranked[0], baseline, expected_chi2):
        double = None
    best = double or (ranked[0] if ranked else None)
    scores = _of_no_effect(baseline, best, scale, expected_chi2) | _of_effects(ranked, double)
    top = max(scores, key=lambda name: scores[name])
    a_load = best is not None and best.scatters and best.fit.hypothesis.effects == (LOAD,) == (top,)
    behind = _REFUTED if refuted else _IN_BURSTS if a_load and any(scattered.in_bursts for scattered in random) else 0.0
    if behind > 0.0:
        scores["unexplained"] = scores[top] + behind
        top = "unexplained"
    leaders = best.fit.hypothesis.effects if best is not None and top in best.fit.hypothesis.effects else (top,)
    mistaken = mistaken_of(leaders, best is not None and best.scatters)
    probabilities = with_mistakes(softmax(scores), leaders, mistaken)
    if top == "none":
        return Verdict("no-gap", None, probabilities, ranked[0].fit if ranked else None, tuple(ranked), scale)
    if best is None:  # the time ran out before any effect was fitted
        return Verdict("unexplained", None, probabilities, None, (), scale)
    # fits whose friction can be predicted: no experiment separates two random paths
    followed = [candidate.fit for candidate in ranked if not is_random(candidate.fit.hypothesis)]
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
    baseline: Fit, singles: list[Fit], pairs: list[Fit], expected_chi2: float, random: Sequence[RandomFriction]
) -> tuple[list[RankedFit], list[RankedFit], float]:
    """Single effects and pairs with their evidence, and the misfit that all evidence is divided by."""

    def scattered(noise: float) -> list[tuple[Fit, str, Scattered]]:
        """For every random effect and every fit that it is added to: the fit, the effect's name, and both together."""
        scattered_fits: list[tuple[Fit, str, Scattered]] = []
        for effect in random:
            others = [single for single in singles if effect.effect not in single.hypothesis.effects][:_UNDER_RANDOM]
            # a real track has more than the two waves of its form; without its random part the rest would be named as a load
            with_effect = [fit for fit in singles[:_UNDER_RANDOM] if effect.effect in fit.hypothesis.effects]
            scattered_fits += [(fit, effect.effect, effect.on(fit, noise)) for fit in (baseline, *others, *with_effect)]
        return scattered_fits

    closest = scattered(JITTER)
    fits = [baseline, *singles, *pairs, *(scattered.fit for *_, scattered in closest)]
    scale = max(min(fit.chi2 for fit in fits) / expected_chi2, 1.0)

    def model(fit: Fit) -> RankedFit:
        closer = chi2_of(baseline.residual) - chi2_of(fit.residual)
        likelier = (baseline.chi2 - fit.chi2) - closer
        return RankedFit(fit, 0.5 * closer / (scale * JITTER) + 0.5 * likelier - occam(fit))

    alone = [model(fit) for fit in singles]
    doubles = [model(fit) for fit in pairs]
    for (under, effect, both), (*_, close) in zip(scattered(scale * JITTER), closest, strict=True):
        if close.fit.chi2 > NEVER_WITHOUT_GAP * expected_chi2:
            continue  # a random path is so free that it leaves no more than this where it is the cause
        if under is baseline:
            alone.append(RankedFit(both.fit, both.gained, scatters=True))
        elif effect in under.hypothesis.effects:
            if both.gained > 0.0:
                alone = [candidate for candidate in alone if candidate.fit is not under]
                wave = under._replace(chi2=both.fit.chi2)
                alone.append(RankedFit(wave, model(under).evidence + both.gained, scatters=True))
        else:
            doubles.append(RankedFit(both.fit, model(under).evidence + both.gained, scatters=True))
    return alone, doubles, scale


def _pays(double: RankedFit, first: RankedFit, baseline: Fit, expected_chi2: float) -> bool:
    """Whether a second effect gains enough to be named beside the best single effect."""
    taken = first.fit.chi2 - double.fit.chi2
    closed = taken / max(first.fit.chi2 - expected_chi2, 1.0)
    adds = taken / max(baseline.chi2 - double.fit.chi2, 1.0)
    completes = much_left(first.fit, expected_chi2) and not much_left(double.fit, expected_chi2)
    # A random path takes nearly any rest, so it is not added to a single effect that is explained by itself.
    needless = double.scatters and first.fit.chi2 <= _left_by_right(baseline, first, expected_chi2)
    is_mismatch = adds < _SECOND_ADDS and not completes and not _is_exact(first.fit)
    gained = double.evidence - first.evidence
    return gained >= _COST_OF_SECOND and closed >= _SECOND_CLOSES and not is_mismatch and not needless


def _of_no_effect(baseline: Fit, best: RankedFit | None, scale: float, expected_chi2: float) -> dict[str, float]:
    """The log evidence of `none` and of `unexplained`."""
    certain = max(baseline.chi2 - NEVER_WITHOUT_GAP * expected_chi2, 0.0)
    against_none = 0.5 * certain / JITTER
    none = COST_OF_EFFECT - against_none
    unknown = 0.5 * (baseline.chi2 - expected_chi2) / (scale * JITTER)
    if best is not None:  # the unknown model pays as much for its freedom as the best model of the library
        unknown = best.evidence + 0.5 * (best.fit.chi2 - _left_by_right(baseline, best, expected_chi2)) / (
            scale * JITTER
        )
    unknown -= _COST_OF_UNKNOWN
    if against_none > 0.0:
        return {"none": none, "unexplained": max(unknown, min(against_none, COST_OF_EFFECT))}
    return {"none": none, "unexplained": min(unknown, none - _NO_ALARM)}


def _of_effects(ranked: list[RankedFit], double: RankedFit | None) -> dict[str, float]:
    """The log evidence of every effect of the library; the two effects of a named pair share its evidence."""
    alone = {
        candidate.fit.hypothesis.effects[0]: candidate.evidence for candidate in reversed(ranked)
    }  # the better one of two forms last
    scores: dict[str, float] = {}
    if double is not None:  # both get one evidence, so the effect with the larger evidence alone comes first
        for name in sorted(double.fit.hypothesis.effects, key=lambda name: -alone.get(name, -math.inf)):
            scores[name] = double.evidence - math.log(2.0)
    for name in (*alone, *EFFECTS):
        scores.setdefault(name, alone.get(name, -30.0))
    return scores


def is_of_one_place(fit: Fit) -> bool:
    """Whether a fit has waves of the track and nothing else; another stretch of the track may have other waves."""
    return fit.hypothesis.effects == (TRACK,) and not is_random(fit.hypothesis)


def of_another_place(
    baseline: Fit, singles: list[Fit], expected_chi2: float, random: Sequence[RandomFriction]
) -> Verdict | None:
    """The verdict without the waves of the track, if friction that varies at random then wins; otherwise None.

    For a verdict that a held-out run on another stretch of the track refutes: there the scatter may fit where the waves do not.
    """
    verdict = judge(baseline, [fit for fit in singles if not is_of_one_place(fit)], [], expected_chi2, random)
    return verdict if verdict.named is not None and is_random(verdict.named.hypothesis) else None


def refittable(verdict: Verdict) -> bool:
    """Whether the verdict names a single effect that is not random, so that it can be refitted to a prediction."""
    named = verdict.named
    return named is not None and len(named.hypothesis.effects) == 1 and not is_random(named.hypothesis)


def doubted(verdict: Verdict) -> Verdict:
    """The same answer with a lower probability, for a fit that leaves more of the held-out runs than right fits do."""
    assert verdict.named is not None, "nothing is named"  # noqa: S101
    leaders = verdict.named.hypothesis.effects
    return verdict._replace(probabilities=with_mistakes(verdict.probabilities, leaders, MISTAKEN_DOUBTFUL))


def with_outside(verdict: Verdict, imitators: frozenset[str] = frozenset()) -> Verdict:
    """The verdict where the runs show a vibration that no feature compares and no effect of the library makes.

    "No gap" becomes "unexplained", and so does a verdict that names only effects of `imitators`, which that vibration imitates.
    """
    named = verdict.named
    if verdict.kind == "no-gap":
        won = "none"
    elif named is not None and imitators.issuperset(named.hypothesis.effects):
        won = named.hypothesis.effects[0]
    else:
        return verdict
    probabilities = swapped(verdict.probabilities, won, "unexplained")
    return verdict._replace(
        kind="unexplained", named=None, runner_up=named or verdict.runner_up, probabilities=probabilities, outside=True
    )
