"""Interleaved calculations: each gets the answers to its questions, as if it ran alone."""

import numpy as np
import pytest

from diagnosis.fits.batch import AT_ONCE, Question, together


def halving(start: float, turns: int):
    """Halve the number `turns` times by questions, each with an answer that is not needed."""
    value = start
    for _ in range(turns):
        half, _ = yield Question([(np.array([value]), {}), (np.array([1e9]), {})], [(np.array([0.5 * value]), {})])
        value = float(half[0])
    return value


class Halves:
    """Answers with halves; counts the questions of each call."""

    def __init__(self) -> None:
        self.asked: list[int] = []
        self.perhaps: list[int] = []

    def __call__(self, points, perhaps=()):
        self.asked.append(len(points))
        self.perhaps.append(len(perhaps))
        return [0.5 * deviations for deviations, _ in points]


def test_each_gets_its_own_answers_in_the_order_of_the_works():
    turns = 2 * [3, 0, 2, 7, 2, 0, 5, 4, 6, 2, 8, 3]  # more than go side by side; some ask for nothing at all
    halves = Halves()
    answers = together(halves, [halving(64.0 + number, count) for number, count in enumerate(turns)])
    assert answers == [(64.0 + number) / 2.0**count for number, count in enumerate(turns)]
    assert max(halves.asked) == 2 * AT_ONCE
    assert sum(halves.asked) == 2 * sum(turns)
    assert halves.perhaps == [asked // 2 for asked in halves.asked]


def test_no_work_asks_no_question():
    halves = Halves()
    assert together(halves, []) == []
    assert halves.asked == []


def test_an_error_in_one_calculation_is_raised():
    def wrong():
        yield Question([(np.zeros(1), {})])
        raise ValueError("no such rig")

    with pytest.raises(ValueError, match="no such rig"):
        together(Halves(), [halving(1.0, 3), wrong()])
