"""One thread for linear algebra, several for simulations."""

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from threadpoolctl import threadpool_limits

T = TypeVar("T")
R = TypeVar("R")


def one_thread() -> threadpool_limits:
    """A context in which linear algebra has one thread.

    Several threads add in another order, and a fit amplifies a change in the last bit (docs/method/diagnosis.md).
    """
    return threadpool_limits(limits=1)


def each(jobs: int, function: Callable[[T], R], items: Iterable[T]) -> list[R]:
    """`function(item)` for every item, in the order of the items, in `jobs` threads: simulations run without Python's lock."""
    if jobs == 1:
        return [function(item) for item in items]
    with ThreadPoolExecutor(jobs) as pool:
        return list(pool.map(function, items))
