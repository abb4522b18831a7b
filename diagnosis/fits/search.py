"""From every effect of the library to the few that are refitted, and the pairs of them.

Screening only shortlists: one simulation a trial says how much of the remaining difference its direction could take, nuisances
moving along, and the inner products of these directions say the same of every pair. What is on the list is refitted in one batch,
and only the refit counts.
"""

from collections import Counter

import numpy as np

from bridge.arrays import Floats
from diagnosis.fits.batch import Work
from diagnosis.fits.fit import Fit
from diagnosis.fits.gauss_newton import Fitter
from diagnosis.fits.refits import Start, best_of_each, each_beside, refits
from diagnosis.fits.screening import Screened, Screening, screened
from diagnosis.hypotheses.hypothesis import LEVELS, NOTHING, Hypothesis
from diagnosis.hypotheses.starts import Trial

# Starts of a screening that get two steps of a refit, of different effects first; `_OF_ONE` of an effect at most. Fewer: a right
# effect is passed over, as what a trial promises is linear. More: time.
_QUICK, _OF_ONE = 8, 3
_FULL = 3  # of them that are refitted to the end,
_WORTH_FULL = 0.4  # of the best one's gain, or they are too far behind to matter
_SIZES = (-2.0, -1.0, -0.5, 0.5, 1.0, 2.0)  # of an effect's scale
_PAIRS = 4  # pairs of effects that get two steps of a refit, of those that directions promise and of those beside the best one
_FULL_PAIRS = 2
_SAME_STARTS = 5  # at most, for the middle of several fits
_LEAST_OF_SECOND = 15.0  # of chi2 that a second effect would take by its direction; less never pays


def refitted(
    fitter: Fitter,
    base_chi2: float,
    screening: Screening,
    hinted: frozenset[str] = frozenset(),
    jobs: int = 1,
    least: float = 0.0,
) -> list[Fit]:
    """The refits of what a screening promises most, the best one of every effect, best first.

    A large effect is not linear: those that are a number of the rig table also begin from the rig as described, at the best of
    some sizes.

    Args:
        fitter: of the fitted runs.
        base_chi2: of the rig without effects.
        screening: of the rig without effects.
        hinted: effects that are refitted whatever they promise.
        jobs: processes.
        least: gain of chi2 in two steps, below which no fit goes on to the end.

    """
    starts = _shortlist(screening.singles, hinted) + _levels(screening.singles)
    return _refitted(fitter, base_chi2, starts, _FULL, jobs, least)


def refitted_rest(fitter: Fitter, base: Fit, seen: list[Fit], trials: list[Trial], jobs: int = 1) -> list[Fit]:
    """Every effect that no shortlist had, in every form, from where it was to be tried; waves begin where the data have them."""
    known = {effect for fit in seen for effect in fit.hypothesis.effects}
    others = [trial for trial in trials if not known & set(trial.hypothesis.effects) and not _is_wave(trial.hypothesis)]
    described = np.zeros_like(base.deviations)
    starts = [
        ((screened.hypothesis, described, screened.w), base.chi2) for screened in best_of_each(others, by_form=True)
    ]
    return best_of_each(sorted(each_beside(jobs, _trying, fitter, starts), key=lambda fit: fit.chi2))


def pairs_of_effects(
    fitter: Fitter, singles: list[Fit], screening: Screening, trials: list[Trial], jobs: int = 1
) -> list[Fit]:
    """The best fits of two effects at once, best first; none where no second effect would take anything.

    Two lists: the pairs that the directions at the origin promise, and what a new screening promises beside the best effect.

    Args:
        fitter: of the fitted runs.
        singles: single effects, best first, at least one.
        screening: of the rig without effects.
        trials: what to add to the best one.
        jobs: processes.

    """
    best = singles[0].chi2
    beside = best_of_each(screened(fitter, singles[0], trials, jobs, paired=False).singles)[:_PAIRS]
    starts = [start for start in (*screening.pairs[:_PAIRS], *beside) if start.chi2 < best - _LEAST_OF_SECOND]
    return _refitted(fitter, best, starts, _FULL_PAIRS, jobs)


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


def _shortlist(screened: list[Screened], hinted: frozenset[str]) -> list[Screened]:
    """The best start of the leading effects and of those hinted, then their next starts."""
    best = best_of_each(screened)
    chosen = best[: _QUICK - 2] + [start for start in best[_QUICK - 2 :] if hinted & set(start.hypothesis.effects)]
    count = Counter(start.hypothesis.effects for start in chosen)
    taken = {id(start) for start in chosen}
    for start in screened:
        if len(chosen) >= _QUICK + len(hinted):
            break
        if id(start) not in taken and 0 < count[start.hypothesis.effects] < _OF_ONE:
            count[start.hypothesis.effects] += 1
            chosen.append(start)
    return chosen


def _levels(screened: list[Screened]) -> list[Screened]:
    """Effects that are a number of the rig table, from where the rig is described, to begin at the best of some sizes."""
    starts: list[Screened] = []
    for start in best_of_each(screened):
        if set(start.hypothesis.effects) <= LEVELS.keys():
            first, *others = [(np.zeros_like(start.deviations), np.array([size])) for size in _SIZES]
            starts.append(Screened(start.hypothesis, *first, start.chi2, tuple(others)))
    return starts


def _refitted(
    fitter: Fitter, base_chi2: float, starts: list[Screened], most: int, jobs: int, least: float = 0.0
) -> list[Fit]:
    """The starts refitted a little, and the best `most` effects or pairs that are worth it to the end; best of each first."""
    quick = best_of_each(sorted(each_beside(jobs, _quick, fitter, starts), key=lambda fit: fit.chi2))
    gain = base_chi2 - quick[0].chi2 if quick else 0.0
    worth = [fit for fit in quick[:most] if base_chi2 - fit.chi2 > max(_WORTH_FULL * gain, least)]
    worth.sort(key=lambda fit: -len(fit.w))  # long refits first: else one process ends with one, alone
    full = refits(fitter, [(fit.hypothesis, fit.deviations, fit.w) for fit in worth], jobs)
    done = {id(fit) for fit in worth}
    others = [fit for fit in quick if id(fit) not in done]
    return best_of_each(sorted((*full, *others), key=lambda fit: fit.chi2))


def _is_wave(hypothesis: Hypothesis) -> bool:
    return any(axis.name == "phase_rad" for axis in hypothesis.coordinates)


def _quick(fitter: Fitter, start: Screened) -> Work[Fit]:
    return fitter.quick(start.hypothesis, ((start.deviations, start.w), *start.others))


def _trying(fitter: Fitter, work: tuple[Start, float]) -> Work[Fit]:
    start, base_chi2 = work
    return fitter.trying(*start, base_chi2)
