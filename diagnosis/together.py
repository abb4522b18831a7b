"""Many fits at once: what each of them wants predicted next goes through the runs side by side with what the others want."""

from collections.abc import Callable, Generator, Iterator, Sequence
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from diagnosis.lanes import LANES
from diagnosis.twin import Effects

Floats = npt.NDArray[np.floating[Any]]
R = TypeVar("R")
AT_ONCE = 2 * LANES  # works: many ask for one point at a time
At = tuple[Floats, Effects]  # deviations of the nuisances, and effects
# a calculation that yields points, is sent the features predicted there, and returns what it found
Work = Generator[Sequence[At], list[Floats], R]


def together(predicted: Callable[[Sequence[At]], list[Floats]], works: Sequence[Work[R]]) -> list[R]:
    """What every work returns, in their order; `AT_ONCE` of them at a time."""
    results: dict[int, R] = {}
    waiting: dict[int, Work[R]] = {}
    wanted: dict[int, Sequence[At]] = {}
    coming: Iterator[tuple[int, Work[R]]] = iter(enumerate(works))

    def on(number: int, answer: list[Floats] | None) -> None:
        try:
            wanted[number] = next(waiting[number]) if answer is None else waiting[number].send(answer)
        except StopIteration as end:
            results[number] = end.value
            del waiting[number]

    while len(results) < len(works):
        while len(waiting) < AT_ONCE and (begun := next(coming, None)):
            number, work = begun
            waiting[number] = work
            on(number, None)
        asked, wanted = wanted, {}
        found = predicted([point for points in asked.values() for point in points])
        for number, points in asked.items():
            answer, found = found[: len(points)], found[len(points) :]
            on(number, answer)
    return [results[number] for number in range(len(works))]
