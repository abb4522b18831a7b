"""From every effect of the library to the few that are refitted in full.

Screening only shortlists: one simulation a trial says how much of the remaining difference its direction could take, nuisances
moving along. It is done twice, where the rig was retuned and where it was described: a large effect pulls the retuned rig far
away, into a valley of its own. What survives is refitted, and only the refit counts.
"""

import math
from collections import Counter
from typing import Any

import numpy as np
import numpy.typing as npt

from diagnosis.fits.batch import Work
from diagnosis.fits.expected import much_left
from diagnosis.fits.fit import Fit
from diagnosis.fits.gauss_newton import Fitter
from diagnosis.fits.refits import Start, best_of_each, each_beside, refits
from diagnosis.fits.screening import Origin, Screened, beside_origin
from diagnosis.hypotheses.hypothesis import LEVELS, NOTHING, Hypothesis
from diagnosis.hypotheses.starts import Trial

Floats = npt.NDArray[np.floating[Any]]
_QUICK = 8  # trials of a screening that get two steps of a refit,
_QUICK_AT_LEAST = 4  # these whatever they promise,
_QUICK_OF_FORM = 4  # but no more of one form: a track has some thirty starts
_PROMISING = 5.0  # the others if they would take this much of chi2
_PROMISING_MUCH = 40.0
_FULL = 3  # single effects that are refitted to the end,
_FULL_PAIRS = 2  # and pairs of effects,
_WORTH_FULL = 0.2  # of the best one's gain, or they are too far behind to matter
_SIZES = (-2.0, -1.0, -0.5, 0.5, 1.0, 2.0)  # of an effect's scale
_PAIRED = 3  # single effects that get a second one: the strongest of two need not fit best alone,
_WORTH_PAIRING = 0.25  # if they close this share of what the best one closes
_SAME_STARTS = 5  # at most, for the middle of several fits
_RESONANCE = "piezo-resonance"
_LEAST_OF_SECOND = 15.0  # of chi2 that a second effect would take by its direction; less never pays


def refitted(fitter: Fitter, origins: list[Origin], found: list[list[Screened]], jobs: int = 1) -> list[Fit]:
    """The best fit of every effect that was worth one, each in its best form, best first.

    Args:
        fitter: of the fitted runs.
        origins: fits of the rig without effects; the first is the one to improve on.
        found: what was screened from each of them.
        jobs: processes.

    """
    starts: list[Screened] = []
    promising: list[Screened] = []
    for (base, _), trials in zip(origins, found, strict=True):
        first = _first(trials)
        promising += _promising_waves(first, base.chi2)
        starts += [one for i, one in enumerate(first) if i < _QUICK_AT_LEAST or one.chi2 < base.chi2 - _PROMISING]
    if len(origins) > 1:
        starts += _of_any_size(origins, found[0])
        promising += _levels(origins[-1].fit, found[-1])
    return _refitted(fitter, origins[0].fit.chi2, starts, promising, jobs, _FULL)


def refitted_rest(
    fitter: Fitter, origins: list[Origin], found: list[list[Screened]], trials: list[Trial], jobs: int = 1
) -> list[Fit]:
    """As `refitted`, from the last origin: the best start of every form that it passed over, and every form as it was tried.

    What a trial promises is linear: friction 0.4 ms behind the velocity was the 63rd of 86, and took chi2 from 640 to 426.
    Screening sent a roll-off of 9 kHz to 23, from where it came to 310; from 4 kHz, where it was to be tried, to 77. A wave
    begins where the data have it, or nowhere. Resonances have a valley between any two frequencies that were commanded: one of
    3.4 kHz beside a Stribeck velocity came to 231 from there, and was not among the best five from the first start alone.
    """
    seen = best_of_each(_first(found[-1]), by_form=True)
    passed_over = best_of_each(found[-1], by_form=True)[len(seen) :]
    fits = _refitted(fitter, origins[0].fit.chi2, passed_over, [], jobs, _FULL)
    described = origins[-1].fit.deviations
    others = [
        trial for trial in trials if _RESONANCE not in trial.hypothesis.effects and not _is_wave(trial.hypothesis)
    ]
    as_tried = best_of_each(others, by_form=True) + [
        trial for trial in trials if _RESONANCE in trial.hypothesis.effects
    ]
    base_chi2 = origins[0].fit.chi2
    fits += each_beside(
        jobs, _trying, fitter, [((trial.hypothesis, described, trial.w), base_chi2) for trial in as_tried]
    )
    return best_of_each(sorted(fits, key=lambda fit: fit.chi2))


def pairs_with(fitter: Fitter, first: Fit, trials: list[Trial], jobs: int = 1) -> list[Fit]:
    """As `pairs_of_effects`, of one effect with every form of every other.

    `pairs_of_effects` begins before the single effects are where they end. From a Coulomb friction that was not there yet the
    Stribeck velocity beside it was passed over, and with it chi2 falls from 2609 to 264.
    """
    starts = best_of_each(beside_origin(fitter, first, trials, jobs), by_form=True)
    return _refitted(fitter, first.chi2, starts, [], jobs, _FULL)


def _is_wave(hypothesis: Hypothesis) -> bool:
    return any(axis.name == "phase_rad" for axis in hypothesis.coordinates)


def pairs_of_effects(
    fitter: Fitter, base: Fit, singles: list[Fit], trials: list[Trial], expected_chi2: float, jobs: int = 1
) -> list[Fit]:
    """The best fits of two effects at once, best first; none where no second effect would take anything.

    Args:
        fitter: of the fitted runs.
        base: the rig without effects.
        singles: single effects, best first, at least one.
        trials: what to add to them.
        expected_chi2: of a perfect model.
        jobs: processes.

    """
    best = singles[0].chi2
    firsts = singles[:1]
    if much_left(singles[0], expected_chi2):
        firsts = [one for one in singles[:_PAIRED] if base.chi2 - one.chi2 > _WORTH_PAIRING * (base.chi2 - best)]
    starts: list[Screened] = []
    for first in firsts:
        starts += _first(beside_origin(fitter, first, trials, jobs))
    worth = sorted((one for one in starts if one.chi2 < best - _LEAST_OF_SECOND), key=lambda one: one.chi2)
    return _refitted(fitter, best, worth[:_QUICK], _promising_waves(worth, best), jobs, _FULL_PAIRS)


def middle_fits(fitter: Fitter, none: Fit, singles: list[Fit], named: Fit, jobs: int = 1) -> tuple[Fit, Fit]:
    """The rig without effects and the named effect again, each from the same starts: the middle fit of each.

    Effects were refitted from many starts, the rig without from few: the best of many valleys of a jagged chi2 is deeper by
    chance. With the Stribeck velocity on evidence without a gap that was 209 against 243, the middle ones 247 and 239.
    """
    starts = [named, none, *(fit for fit in singles if fit is not named)][:_SAME_STARTS]

    def middle(hypothesis: Hypothesis, w: Floats) -> Fit:
        fits = refits(fitter, [(hypothesis, start.deviations, w) for start in starts], jobs)
        return sorted(fits, key=lambda fit: fit.chi2)[len(fits) // 2]

    return middle(NOTHING, np.zeros(0)), middle(named.hypothesis, named.w)


def _promising_waves(found: list[Screened], chi2: float) -> list[Screened]:
    """The first start of each of the two effects, or pairs, with a wave that promise most, if they promise much."""
    much = [start for start in found if start.chi2 < chi2 - _PROMISING_MUCH]
    waves = [start for start in much if _is_wave(start.hypothesis)]
    first = {frozenset(start.hypothesis.effects): start for start in reversed(waves)}
    return sorted(first.values(), key=lambda start: start.chi2)[:2]


def _of_any_size(origins: list[Origin], screened: list[Screened]) -> list[Screened]:
    """Effects of one number of either sign, to begin at the best of some sizes: screening is linear, and a large one is not."""
    found: list[Screened] = []
    for one in best_of_each(screened, by_form=True):
        if len(one.hypothesis.coordinates) != 1 or one.hypothesis.coordinates[0].logarithmic:
            continue
        first, *others = [(origin.fit.deviations, np.array([size])) for origin in origins for size in _SIZES]
        found.append(Screened(one.hypothesis, *first, math.inf, tuple(others)))
    return found


def _first(screened: list[Screened]) -> list[Screened]:
    """The most promising, of no form more than a few."""
    of_form: Counter[str] = Counter()
    found: list[Screened] = []
    for one in screened:
        key = str(one.hypothesis.forms)
        of_form[key] += 1
        if of_form[key] <= _QUICK_OF_FORM:
            found.append(one)
    return found[:_QUICK]


def _levels(described: Fit, screened: list[Screened]) -> list[Screened]:
    """Effects that are one number of the rig table, from where that is described, in the direction that screening has.

    Two steps say little of them: a Coulomb friction of 10 detection limits was 25th at chi2 2800, where a drift had 357 and was
    named; from here it came to 325.
    """
    own = [one for one in best_of_each(screened) if set(one.hypothesis.effects) <= LEVELS.keys()]
    return [one._replace(deviations=described.deviations, w=np.copysign(0.5, one.w), others=()) for one in own]


def _refitted(
    fitter: Fitter, chi2: float, starts: list[Screened], promising: list[Screened], jobs: int, most: int
) -> list[Fit]:
    """The starts refitted a little, and the best `most` effects or pairs that are worth it to the end.

    The `promising` are refitted to the end in any case: a wave begins where the data have it, and two steps can lead it astray.
    One of the friction that screening saw at 241 went to 981 in two steps and to 198 in a whole refit, others to 602. Those whose
    two steps lead on to the end came no further from where they began: to 921 instead of 890, to 752 instead of 664.
    """
    two_steps = each_beside(jobs, _quick, fitter, starts)
    quickly = sorted(two_steps, key=lambda fit: fit.chi2)
    best = best_of_each(quickly)
    gain = chi2 - best[0].chi2 if best else 0.0
    worth = [fit for fit in best[:most] if chi2 - fit.chi2 > _WORTH_FULL * gain]
    names = [set(fit.hypothesis.effects) for fit in worth]
    forms: list[Fit] = []
    for effects in names:
        forms += best_of_each([fit for fit in quickly if set(fit.hypothesis.effects) == effects], by_form=True)[:2]
    led_on = {id(start) for start, fit in zip(starts, two_steps, strict=True) if any(fit is one for one in forms)}
    again = [*(one for one in promising if id(one) not in led_on), *forms]
    again.sort(
        key=lambda one: -len(one.hypothesis.coordinates)
    )  # long refits first: else one process ended with one, alone for 4 s
    finished = refits(fitter, [(one.hypothesis, one.deviations, one.w) for one in again], jobs)
    finished += [fit for fit in best if set(fit.hypothesis.effects) not in names]
    return best_of_each(sorted(finished, key=lambda fit: fit.chi2))


def _quick(fitter: Fitter, one: Screened) -> Work[Fit]:
    # where nuisances move far, not all is linear: a slow force sensor went to 5061 from there and to 341 from where they were
    return fitter.quick(one.hypothesis, ((one.deviations, one.w), *one.others))


def _trying(fitter: Fitter, work: tuple[Start, float]) -> Work[Fit]:
    start, base_chi2 = work
    return fitter.trying(*start, base_chi2)
