"""One function on many items, in several processes; the result does not depend on the number of processes."""

from collections.abc import Callable, Sequence
from typing import TypeVar

from joblib import Parallel, delayed  # pyright: ignore[reportUnknownVariableType]
from threadpoolctl import threadpool_limits

S = TypeVar("S")
T = TypeVar("T")
R = TypeVar("R")


def one_thread() -> threadpool_limits:
    """A context in which linear algebra has one thread.

    Several threads add in another order, and a fit amplifies a change in the last bit (docs/method/diagnosis.md).
    """
    return threadpool_limits(limits=1)


def _alone(function: Callable[[S, T], R], shared: S, item: T) -> R:
    with one_thread():
        return function(shared, item)


def each(jobs: int, function: Callable[[S, T], R], shared: S, items: Sequence[T]) -> list[R]:
    """`function(shared, item)` for every item, in the order of the items, in `jobs` processes.

    With more than one process, `function`, `shared` and the items are pickled.
    """
    if jobs == 1:
        return [function(shared, item) for item in items]
    # max_nbytes=None: joblib makes memory maps of arrays above 1 MB, which takes 0.1 s a call; sending them takes 0.02 s
    results: list[R] = Parallel(n_jobs=jobs, max_nbytes=None)(delayed(_alone)(function, shared, item) for item in items)  # pyright: ignore[reportAssignmentType]
    return results


def spread(jobs: int, function: Callable[[S, list[T]], list[R]], shared: S, items: Sequence[T]) -> list[R]:
    """The results of `function(shared, some items)`, a result for each item, in `jobs` processes; in the order of the items."""
    shares = each(jobs, function, shared, [list(items[i::jobs]) for i in range(jobs)])
    return [shares[number % jobs][number // jobs] for number in range(len(items))]
