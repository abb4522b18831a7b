"""Late commands inside and outside of the machine's pauses, on made accounts of the plant."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bridge.log.logfile import RunData, read_run
from bridge.log.pause_events import CORE_PAUSE, NOT_WATCHED, PAUSE, WATCH, in_words
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import APPLIED
from cockpit.judge.pauses import Pauses, pauses_in, pauses_in_words
from cockpit.judge.verdict import judge_run
from cockpit.run.progress import progress_line
from tests.logs import short_log

BLOCKS, MS = 1000, 1_000_000
Late = dict[int, float]  # how late a command was [ms], by the block that it answers


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> RunData:
    path = tmp_path_factory.mktemp("log") / "run.mcap"
    path.write_bytes(short_log())
    return read_run(path)


def account(late_ms: Late, held_ms: tuple[int, int] = (0, 0)) -> Any:
    """What the plant says of BLOCKS blocks whose commands take 0.3 ms, or what `late_ms` says, and come in order; inf: never.

    `held_ms`: from and until when the plant itself stood still, and nothing was sent or taken.
    """
    table = APPLIED.blank(BLOCKS)
    due_ms = np.arange(BLOCKS) + 1.0
    made_ms = np.where((due_ms >= held_ms[0]) & (due_ms < held_ms[1]), held_ms[1], due_ms)
    took_ms = np.full(BLOCKS, 0.3)
    for block, took in late_ms.items():
        took_ms[block] = took
    came_ms = np.maximum.accumulate(np.where(np.isfinite(took_ms), made_ms + took_ms, 0.0))
    took_ms = np.where(np.isfinite(took_ms), came_ms - made_ms, np.inf)
    came_ms = made_ms + took_ms
    table["sequence"], table["t_ns"] = np.arange(BLOCKS), (due_ms * MS).astype(np.int64)
    table["late_ns"] = ((made_ms - due_ms) * MS).astype(np.int64)
    newest, previous_ms = 2**64 - 1, -np.inf
    for row in range(BLOCKS):
        now = np.flatnonzero((came_ms > previous_ms) & (came_ms <= made_ms[row]) & (np.arange(BLOCKS) < row))
        if len(now):
            newest = int(now[-1])
            table["round_trip_ns"][row] = int(took_ms[newest] * MS)
        table["command_block"][row], table["commands"][row] = newest, len(now)
        table["commands_late"][row] = np.count_nonzero(took_ms[now] > 1.0)
        previous_ms = made_ms[row]
    return table


def event(code: str, text: str, t_ms: float = 0.0) -> wire.Event:
    return wire.Event(source="recorder", code=code, text=text, t_ns=round(t_ms * MS))


def watched(run: RunData, applied: Any, *pauses_ms: tuple[float, float]) -> RunData:
    told = [event(PAUSE, in_words(round(length * MS), None), t_ms) for t_ms, length in pauses_ms]
    return run._replace(
        applied=applied, events=[event(WATCH, "pauses of the machine are watched on 2 cores: 0, 1"), *told]
    )


def found(run: RunData, applied: Any, *pauses_ms: tuple[float, float]) -> Pauses:
    pauses, why_not = pauses_in(watched(run, applied, *pauses_ms), 1e6)
    assert pauses is not None
    assert why_not == ""
    return pauses


def test_a_command_across_a_pause_is_late_inside_and_another_outside(run: RunData) -> None:
    applied = account({500: 1.5, 800: 1.2})
    pauses = found(run, applied, (501.2, 1.1))
    assert (pauses.number, pauses.total_ms, pauses.longest_ms) == (1, pytest.approx(1.1), pytest.approx(1.1))
    assert (pauses.late_inside, pauses.late_outside) == (1, 1)
    assert pauses.within_1_ms_outside == pytest.approx(1 - 1 / BLOCKS, abs=1e-5)
    assert found(run, applied).late_outside == 2
    assert found(run, applied, (400.0, 30.0), (600.0, 30.0)).late_inside == 0


def test_a_command_that_is_late_while_one_core_stands_still_is_outside_and_counted_apart(run: RunData) -> None:
    told = watched(run, account({500: 1.5, 800: 1.2}), (501.2, 1.1))
    alone = [event(CORE_PAUSE, in_words(2 * MS, 1), t_ms) for t_ms in (500.5, 801.0)]
    pauses, _ = pauses_in(told._replace(events=[*told.events, *alone]), 1e6)
    assert pauses is not None
    assert (pauses.number, pauses.late_inside, pauses.late_outside, pauses.late_one_core) == (1, 1, 1, 1)
    assert "1 late command outside of them (1 while one core stood still alone)" in pauses_in_words(pauses, "")[0]


def test_blocks_that_were_due_in_a_pause_are_inside_it(run: RunData) -> None:
    late = {block: 1.0 + 0.02 * (block - 300) for block in range(301, 320)}
    pauses = found(run, account(late, held_ms=(301, 321)), (300.8, 20.1))
    assert (pauses.late_inside, pauses.late_outside) == (19, 1)  # block 320, due after the pause, waits behind them


def test_a_loop_that_stood_still_by_itself_is_late_outside(run: RunData) -> None:
    late = {400: 201.5}  # and all that wait behind it
    pauses = found(run, account(late), (100.0, 5.0))
    assert (pauses.late_inside, pauses.late_outside) == (0, 201)
    assert pauses.within_1_ms_outside == pytest.approx(0.798, abs=0.001)
    short = found(run, account(late), (450.0, 4.0))  # a short pause meanwhile excuses nothing
    assert (short.late_inside, short.late_outside) == (0, 201)


def test_commands_that_never_come_are_late(run: RunData) -> None:
    lost = dict.fromkeys((200, 201, 700, BLOCKS - 2), np.inf)
    pauses = found(run, account(lost), (201.5, 1.0))
    assert (pauses.late_inside, pauses.late_outside) == (2, 2)


def test_rows_that_the_log_lacks_are_no_late_commands(run: RunData) -> None:
    applied = account({})
    assert found(run, np.delete(applied, slice(300, 340))).late_outside == 0


def test_where_nothing_was_watched_no_figure_is_given(run: RunData) -> None:
    applied = account({500: 1.5})
    refused = run._replace(applied=applied, events=[event(WATCH, NOT_WATCHED + "no real-time priority")])
    verdict = judge_run(refused)
    assert verdict.pauses is None
    assert verdict.not_watched == "no real-time priority"
    assert "pauses   of the machine not watched: no real-time priority" in pauses_in_words(None, verdict.not_watched)
    assert judge_run(run._replace(applied=applied)).not_watched == "the recorder of this log did not"
    assert judge_run(run).not_watched == ""  # in lockstep nobody has to


def test_the_progress_line_tells_of_pauses_once_there_are_some() -> None:
    assert "paused" not in progress_line(wire.State(), 10.0)
    assert progress_line(wire.State(), 10.0, pauses=2, paused_ms=14.4).endswith("  machine paused 2 x, 14 ms")


def test_what_the_verdict_says(run: RunData, tmp_path: Path) -> None:
    applied = account({500: 1.5, 800: 1.2})
    verdict = judge_run(watched(run, applied, (501.2, 1.1), (900.0, 12.0)))
    assert pauses_in_words(verdict.pauses, verdict.not_watched) == [
        "pauses   the machine stood still 2 times, 13.1 ms in all, the longest 12.0 ms; 1 late command in its pauses, "
        "1 late command outside of them: 99.898 % within 1 ms there"
    ]
    assert verdict.as_dict()["pauses"]["number"] == 2
    assert pauses_in_words(found(run, applied), "") == ["pauses   none of the machine; 2 late commands"]
