"""Many refits spread over processes, and the best of each."""

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from diagnosis.fits.batch import Work, together
from diagnosis.fits.fit import Fit
from diagnosis.fits.gauss_newton import Fitter
from diagnosis.fits.screening import Screened
from diagnosis.hypotheses.hypothesis import Hypothesis
from diagnosis.hypotheses.trials import Trial
from diagnosis.processes import each

Floats = npt.NDArray[np.floating[Any]]

Start = tuple[Hypothesis, Floats, Floats]  # of a refit: nuisances, then the effect's coordinates


_Formed = TypeVar("_Formed", Fit, Screened, Trial)
T = TypeVar("T")


def refits(fitter: Fitter, starts: Sequence[Start], jobs: int) -> list[Fit]:
    """A refit to the end from every start."""
    return each_beside(jobs, _refitting, fitter, starts)


def _refitting(fitter: Fitter, start: Start) -> Work[Fit]:
    return fitter.refitting(*start)


def each_beside(jobs: int, work: Callable[[Fitter, T], Work[Fit]], fitter: Fitter, items: Sequence[T]) -> list[Fit]:
    """What becomes of every item, beside the others, in `jobs` processes."""
    shares = each(jobs, _share, fitter, [(work, items[i::jobs]) for i in range(jobs)])
    return [shares[number % jobs][number // jobs] for number in range(len(items))]


def _share(fitter: Fitter, share: tuple[Callable[[Fitter, T], Work[Fit]], Sequence[T]]) -> list[Fit]:
    work, items = share
    return together(fitter.predicted_many, [work(fitter, item) for item in items])


def best_of_each(found: list[_Formed], by_form: bool = False) -> list[_Formed]:
    """The first of every effect, or of every form of it, in their order."""
    seen: set[frozenset[tuple[str, str]]] = set()
    result: list[_Formed] = []
    for one in found:
        key = frozenset((name, form if by_form else "") for name, form in one.hypothesis.forms.items())
        if key not in seen:
            seen.add(key)
            result.append(one)
    return result
