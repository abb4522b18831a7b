"""Events and ramps where blocks are late, missing or waited for while the controller itself stalled."""

import pytest

from controller.freshness import Freshness

BLOCK_S, STALE_AFTER_S = 0.001, 0.02


def fresh() -> Freshness:
    blocks = Freshness(BLOCK_S, STALE_AFTER_S)
    blocks.heard(0.0)
    return blocks


def codes_of(blocks: Freshness, count: int, in_time: bool = True) -> list[str]:
    return [code for _ in range(count) for code, _ in blocks.heard(1.0, in_time)]


def test_a_silence_is_published_once_and_ramps_one_step_a_block() -> None:
    blocks = fresh()
    assert blocks.due_s == STALE_AFTER_S
    steps = [blocks.missing(blocks.due_s) for _ in range(3)]
    assert [periods for periods, _ in steps] == [20, 1, 1]
    assert [code for _, events in steps for code, _ in events] == ["STALE"]
    assert blocks.due_s == pytest.approx(STALE_AFTER_S + 3 * BLOCK_S)
    blocks.heard(1.0)
    assert blocks.missing(2.0) == (20, [])  # still the same disturbance, as no FRESH came


def test_blocks_count_as_back_once_twenty_in_a_row_are_in_time() -> None:
    blocks = fresh()
    blocks.missing(STALE_AFTER_S)
    assert codes_of(blocks, 19) == []
    assert codes_of(blocks, 5, in_time=False) == []
    assert not blocks.is_fresh
    assert codes_of(blocks, 20) == ["FRESH"]
    assert blocks.is_fresh
    assert blocks.missing(2.0)[1][0][0] == "STALE"


def test_a_stall_of_the_controller_does_not_count_as_silence_of_the_rig_where_blocks_follow() -> None:
    blocks = fresh()
    blocks.stalled(0.5)
    blocks.stalled(0.3)
    assert blocks.missing(1.0) == (20, [])
    blocks.heard(1.0, in_time=False)
    events = [event for _ in range(20) for event in blocks.heard(1.0)]
    assert [code for code, _ in events] == ["PAUSED", "FRESH"]
    assert "stalled for 0.80 s" in events[0][1]
    assert blocks.paused() == []


def test_silence_after_a_stall_of_the_controller_is_published() -> None:
    """The stall counted as the silence, and a rig that was silent from then on was not reported."""
    blocks = fresh()
    blocks.stalled(0.5)
    assert [blocks.missing(1.0)[1] == [], blocks.missing(1.0)[1][0][0]] == [True, "STALE"]
    assert [code for code, _ in blocks.paused()] == ["PAUSED"]
