"""Many refits spread over processes, and the best of each."""

from collections.abc import Callable, Sequence
from typing import TypeVar

from bridge.arrays import Floats
from diagnosis.fits.batch import Work, together
from diagnosis.fits.fit import Fit
from diagnosis.fits.gauss_newton import Fitter
from diagnosis.fits.screening import Screened
from diagnosis.hypotheses.hypothesis import Hypothesis
from diagnosis.processes import spread

# start of a refit: the hypothesis, its nuisances in tolerances [nuisances], its coordinates [coordinates]
Start = tuple[Hypothesis, Floats, Floats]


_Formed = TypeVar("_Formed", Fit, Screened)
T = TypeVar("T")


def refits(fitter: Fitter, starts: Sequence[Start], jobs: int) -> list[Fit]:
    """Refit from every start to the end, in `jobs` processes; the fits have the order of the starts."""
    return each_beside(jobs, _refitting, fitter, starts)


def _refitting(fitter: Fitter, start: Start) -> Work[Fit]:
    return fitter.refitting(*start)


def each_beside(jobs: int, work: Callable[[Fitter, T], Work[Fit]], fitter: Fitter, items: Sequence[T]) -> list[Fit]:
    """Turn every item into a fit, many at once in each of `jobs` processes; the fits have the order of the items."""
    return spread(jobs, _fitted, (fitter, work), items)


def _fitted(shared: tuple[Fitter, Callable[[Fitter, T], Work[Fit]]], items: list[T]) -> list[Fit]:
    fitter, work = shared
    return together(fitter.predicted_many, [work(fitter, item) for item in items])


def best_of_each(formed: list[_Formed]) -> list[_Formed]:
    """The first of every set of effects, in the order of `formed`."""
    seen: dict[frozenset[str], _Formed] = {}
    for candidate in formed:
        seen.setdefault(frozenset(candidate.hypothesis.effects), candidate)
    return list(seen.values())
