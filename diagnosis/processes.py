"""The same work on many items, in as many processes as one wants, with the same result in any number of them."""

from collections.abc import Callable, Sequence
from typing import TypeVar

from joblib import Parallel, delayed  # pyright: ignore[reportUnknownVariableType]
from threadpoolctl import threadpool_limits

S = TypeVar("S")
T = TypeVar("T")
R = TypeVar("R")


def one_thread() -> threadpool_limits:
    """A context in which linear algebra has one thread.

    More add up in another order, and fits are jagged: README's example came to 12.6, 13.3 or 13.5 N s/m by the threads at hand.
    """
    return threadpool_limits(limits=1)


def _alone(function: Callable[[S, T], R], shared: S, item: T) -> R:
    with one_thread():
        return function(shared, item)


def each(jobs: int, function: Callable[[S, T], R], shared: S, items: Sequence[T]) -> list[R]:
    """What a function makes of something shared and every item, in `jobs` processes."""
    if jobs == 1:
        return [function(shared, item) for item in items]
    # memory maps of the evidence, which joblib makes of arrays beyond 1 MB, take 0.1 s a call; to send it takes 0.02 s
    results: list[R] = Parallel(n_jobs=jobs, max_nbytes=None)(delayed(_alone)(function, shared, item) for item in items)  # pyright: ignore[reportAssignmentType]
    return results
