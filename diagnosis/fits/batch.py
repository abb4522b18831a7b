"""Many fits at once: the points that all fits ask for next are predicted side by side, in one pass through the runs."""

from collections.abc import Generator, Iterator, Sequence
from itertools import chain
from typing import NamedTuple, Protocol, TypeVar

from bridge.arrays import Floats
from diagnosis.model.rig import Effects
from plant.four_rigs_step import LANES

R = TypeVar("R")
# Works that proceed at the same time. Fewer leave lanes of the prediction empty, as most works ask for one point at a time;
# more hold more predictions in memory.
AT_ONCE = 2 * LANES
At = tuple[Floats, Effects]  # deviations of the nuisances, and effects


class Question(NamedTuple):
    """Points where a work needs the features now, and points that it may need next; those fill lanes left empty."""

    points: Sequence[At]
    perhaps: Sequence[At] = ()


# A work is a generator: it yields questions, receives the features predicted at their points, and returns a result.
Work = Generator[Question, list[Floats], R]


class Predicts(Protocol):
    """A function that predicts features at many points."""

    def __call__(self, at: Sequence[At], perhaps: Sequence[At] = ()) -> list[Floats]:
        """The features [features] at every point of `at`, in the order of `at`."""
        ...


def together(predicted: Predicts, works: Sequence[Work[R]]) -> list[R]:
    """Run all works, `AT_ONCE` of them at a time, and return their results in the order of `works`."""
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
        perhaps = list(chain.from_iterable(question.perhaps for question in asked.values()))
        answers = predicted(list(chain.from_iterable(question.points for question in asked.values())), perhaps)
        for number, question in asked.items():
            answer, answers = answers[: len(question.points)], answers[len(question.points) :]
            on(number, answer)
    return [results[number] for number in range(len(works))]
