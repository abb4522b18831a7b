"""The same work on many items, in as many processes as one wants."""

from collections.abc import Callable, Sequence
from typing import TypeVar

from joblib import Parallel, delayed  # pyright: ignore[reportUnknownVariableType]

S = TypeVar("S")
T = TypeVar("T")
R = TypeVar("R")


def each(jobs: int, function: Callable[[S, T], R], shared: S, items: Sequence[T]) -> list[R]:
    """What a function makes of something shared and every item, in `jobs` processes."""
    if jobs == 1:
        return [function(shared, item) for item in items]
    results: list[R] = Parallel(n_jobs=jobs)(delayed(function)(shared, item) for item in items)  # pyright: ignore[reportAssignmentType]
    return results
