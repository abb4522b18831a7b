"""Many fits at once: what each of them wants predicted next goes through the runs side by side with what the others want."""

from collections.abc import Generator, Iterator, Sequence
from itertools import chain
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from diagnosis.model.four_rigs_step import LANES
from diagnosis.model.rig import Effects

Floats = npt.NDArray[np.floating[Any]]
R = TypeVar("R")
AT_ONCE = 2 * LANES  # works: many ask for one point at a time
At = tuple[Floats, Effects]  # deviations of the nuisances, and effects


class Question(NamedTuple):
    """Points where features are wanted now, and points that may be wanted next: they fill the lanes left empty."""

    points: Sequence[At]
    perhaps: Sequence[At] = ()


# a calculation that yields questions, is sent the features predicted at the points, and returns what it found
Work = Generator[Question, list[Floats], R]


class Predicts(Protocol):
    """What answers questions."""

    def __call__(self, at: Sequence[At], perhaps: Sequence[At] = ()) -> list[Floats]:
        """The features at every point of `at`."""
        ...


def together(predicted: Predicts, works: Sequence[Work[R]]) -> list[R]:
    """What every work returns, in their order; `AT_ONCE` of them at a time."""
    results: dict[int, R] = {}
    waiting: dict[int, Work[R]] = {}
    wanted: dict[int, Question] = {}
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
        perhaps = list(chain.from_iterable(one.perhaps for one in asked.values()))
        found = predicted(list(chain.from_iterable(one.points for one in asked.values())), perhaps)
        for number, one in asked.items():
            answer, found = found[: len(one.points)], found[len(one.points) :]
            on(number, answer)
    return [results[number] for number in range(len(works))]
