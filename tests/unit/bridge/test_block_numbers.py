"""Which numbers are believed: those that go on, and another count only when it goes on while the present one is silent."""

import pytest

from bridge.wire.complaints import BlockNumbers, NumberCheck

MS = 1_000_000


def after(numbers: range) -> BlockNumbers:
    made = BlockNumbers()
    for number in numbers:
        assert made.judge(number, number * MS) is NumberCheck.NEXT
    return made


@pytest.mark.parametrize("first", [0, 12345, 2**62])
def test_the_first_may_have_any_number(first: int) -> None:
    made = BlockNumbers()
    assert made.judge(first, 0) is NumberCheck.NEXT
    assert made.expected == first + 1


def test_a_gap_is_taken_and_a_late_one_is_not() -> None:
    made = after(range(100))
    assert made.judge(355, 355 * MS) is NumberCheck.NEXT
    assert made.judge(200, 356 * MS) is NumberCheck.AGAIN
    assert made.judge(355, 356 * MS) is NumberCheck.AGAIN
    assert made.expected == 356
    assert made.strays == 0


@pytest.mark.parametrize("other", [range(300), range(10**6, 10**6 + 300), range(2**62, 2**62 + 300)])
def test_a_second_count_in_parallel_to_the_present_count_is_never_accepted(other: range) -> None:
    made = after(range(1000, 1010))
    for step, strange in enumerate(other):
        assert made.judge(strange, (1010 + step) * MS) is NumberCheck.STRAY
        assert made.judge(1010 + step, (1010 + step) * MS) is NumberCheck.NEXT
    assert made.strays == 300


def test_a_burst_of_another_count_is_not_believed() -> None:
    made = after(range(1000, 1010))
    assert {made.judge(number, 1010 * MS) for number in range(5000, 5200)} == {NumberCheck.STRAY}
    assert made.strays == 192  # three times 64
    assert made.judge(1010, 1011 * MS) is NumberCheck.NEXT
    assert made.strays == 200


@pytest.mark.parametrize(
    ("first", "verdict"), [(0, NumberCheck.ANEW), (900, NumberCheck.ANEW), (10**6, NumberCheck.NEXT)]
)
def test_another_count_is_believed_where_the_present_one_is_silent(first: int, verdict: NumberCheck) -> None:
    made = after(range(1000, 1010))
    verdicts = [made.judge(first + step, (1100 + step) * MS) for step in range(10)]
    assert verdicts[7:] == [verdict, NumberCheck.NEXT, NumberCheck.NEXT]
    assert set(verdicts[:7]) <= {NumberCheck.STRAY, NumberCheck.AGAIN}
    assert made.strays == 0


def test_a_number_that_is_repeated_is_never_another_count() -> None:
    made = after(range(1000, 1010))
    assert {made.judge(1009, (1100 + step) * MS) for step in range(100)} == {NumberCheck.AGAIN}


def test_a_sender_that_was_away_restarts_the_count_at_once() -> None:
    made = after(range(1000, 1010))
    made.sender_was_away()
    assert made.judge(0, 1011 * MS) is NumberCheck.ANEW
    assert made.judge(1, 1012 * MS) is NumberCheck.NEXT
    assert made.judge(0, 1013 * MS) is NumberCheck.AGAIN
