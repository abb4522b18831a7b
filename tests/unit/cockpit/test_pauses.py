"""Late commands inside and outside of the computer's pauses, on made accounts of the plant."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bridge.log.logfile import RunData, read_run
from bridge.log.watches.event_watch import CORE_PAUSE, NOT_WATCHED, PAUSE, WATCH, in_words
from bridge.results import strict_json
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import APPLIED
from cockpit.judge.pauses import Pauses, computer_in_words, pauses_in_words
from cockpit.run.processes import progress_line
from tests.logs import short_log, verdict_of

BLOCKS, MS = 1000, 1_000_000
Late = dict[int, float]  # how late a command was [ms], by the block that it answers


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> RunData:
    path = tmp_path_factory.mktemp("log") / "run.mcap"
    path.write_bytes(short_log())
    return read_run(path)


def account(late_ms: Late, held_ms: tuple[int, int] = (0, 0)) -> Any:
    """The plant's record of BLOCKS blocks. Commands take 0.3 ms or their `late_ms` (inf: lost) and arrive in order.

    `held_ms`: begin and end of a stall of the plant, in which it neither sends nor receives.
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
    pause_events = [event(PAUSE, in_words(round(length * MS), None), t_ms) for t_ms, length in pauses_ms]
    return run._replace(
        applied=applied, events=[event(WATCH, "pauses of the computer are watched on 2 cores: 0, 1"), *pause_events]
    )


def pauses_of(run: RunData, applied: Any, *pauses_ms: tuple[float, float]) -> Pauses:
    verdict = verdict_of(watched(run, applied, *pauses_ms))
    assert verdict.pauses is not None
    assert verdict.not_watched == ""
    return verdict.pauses


def test_a_command_across_a_pause_is_late_inside_and_another_outside(run: RunData) -> None:
    applied = account({500: 1.5, 800: 1.2})
    pauses = pauses_of(run, applied, (501.2, 1.1))
    assert (pauses.number, pauses.total_ms, pauses.longest_ms) == (1, pytest.approx(1.1), pytest.approx(1.1))
    assert (pauses.late_inside, pauses.late_outside) == (1, 1)
    assert pauses.within_1_ms_outside == pytest.approx(1 - 1 / BLOCKS, abs=1e-5)
    assert pauses_of(run, applied).late_outside == 2
    assert pauses_of(run, applied, (400.0, 30.0), (600.0, 30.0)).late_inside == 0


def test_a_command_that_is_late_while_one_core_stalls_is_outside_and_counted_apart(run: RunData) -> None:
    watched_run = watched(run, account({500: 1.5, 800: 1.2}), (501.2, 1.1))
    alone = [event(CORE_PAUSE, in_words(2 * MS, 1), t_ms) for t_ms in (500.5, 801.0)]
    pauses = verdict_of(watched_run._replace(events=[*watched_run.events, *alone])).pauses
    assert pauses is not None
    assert (pauses.number, pauses.late_inside, pauses.late_outside, pauses.late_one_core) == (1, 1, 1, 1)
    assert pauses_in_words(pauses) == [
        "stalls   every core stalled 1 time (1.1 ms in total, longest 1.1 ms); 1 late command in stalls, "
        "1 command later than 1 ms outside of them (0.10 %), 1 of them while one core stalled"
    ]


def test_blocks_that_were_due_in_a_pause_are_inside_it(run: RunData) -> None:
    late = {block: 1.0 + 0.02 * (block - 300) for block in range(301, 320)}
    pauses = pauses_of(run, account(late, held_ms=(301, 321)), (300.8, 20.1))
    assert (pauses.late_inside, pauses.late_outside) == (19, 1)  # block 320, due after the pause, waits behind them


def test_a_stall_of_the_loop_alone_is_late_outside(run: RunData) -> None:
    late = {400: 201.5}  # and all that wait behind it
    pauses = pauses_of(run, account(late), (100.0, 5.0))
    assert (pauses.late_inside, pauses.late_outside) == (0, 201)
    assert pauses.within_1_ms_outside == pytest.approx(0.798, abs=0.001)
    short = pauses_of(run, account(late), (450.0, 4.0))  # a short pause within the stall excuses nothing
    assert (short.late_inside, short.late_outside) == (0, 201)


def test_every_figure_counts_the_same_late_commands(run: RunData) -> None:
    """Commands that never arrive are blocks without a command, so they count as late nowhere."""
    never: Late = dict.fromkeys((200, 201, 700, BLOCKS - 2), np.inf)
    verdict = verdict_of(watched(run, account(never | {500: 1.5, 800: 1.2}), (501.2, 1.1)))
    assert verdict.pauses is not None
    assert (verdict.pauses.late_inside, verdict.pauses.late_outside, verdict.late_commands) == (1, 1, 2)
    assert "2 late commands" in verdict.losses()


def test_rows_missing_from_the_log_do_not_count_as_late_commands(run: RunData) -> None:
    applied = account({})
    assert pauses_of(run, np.delete(applied, slice(300, 340))).late_outside == 0


def test_where_nothing_was_watched_no_figure_is_given(run: RunData) -> None:
    applied = account({500: 1.5})
    refused = run._replace(applied=applied, events=[event(WATCH, NOT_WATCHED + "no real-time priority")])
    verdict = verdict_of(refused)
    assert verdict.pauses is None
    assert verdict.not_watched == "no real-time priority"
    assert computer_in_words(verdict.computer, verdict.not_watched).endswith("not watched: no real-time priority")
    assert verdict_of(run._replace(applied=applied)).not_watched == "the recorder of this log did not watch them"
    assert verdict_of(run).not_watched == ""  # lockstep needs no watch


def test_the_progress_line_shows_pauses_once_there_are_some() -> None:
    assert "paused" not in progress_line(wire.State(), 10.0)
    assert progress_line(wire.State(), 10.0, pauses=2, paused_ms=14.4).endswith("  computer stalled 2 x, 14 ms")


def test_the_verdict_reports_stalls_in_text_and_json(run: RunData, tmp_path: Path) -> None:
    applied = account({500: 1.5, 800: 1.2})
    verdict = verdict_of(watched(run, applied, (501.2, 1.1), (900.0, 12.0)))
    assert pauses_in_words(verdict.pauses)[0].startswith("stalls   every core stalled 2 times (13.1 ms in total, ")
    assert strict_json(verdict)["pauses"]["number"] == 2
    assert pauses_in_words(pauses_of(run, applied)) == [
        "stalls   no stall of all cores at once; 2 commands later than 1 ms outside of them (0.20 %)"
    ]
    assert computer_in_words(verdict.computer, "") == (
        "computer stalled 2 times, longest 12.0 ms (every core, at 0.90 s)"
    )


def test_the_longest_stall_is_the_larger_of_watch_and_plant(run: RunData) -> None:
    """The log of a demo whose plant was 40.5 ms late read "4.0 ms": the watch saw less than the plant."""
    applied = account({})
    applied["late_ns"][500:503] = np.array([39.1, 40.5, 39.5]) * MS
    verdict = verdict_of(watched(run, applied, (505.0, 4.0), (700.0, 0.8)))
    assert computer_in_words(verdict.computer, "") == (
        "computer stalled 2 times, longest 40.5 ms (plant, at 0.50 s)"  # one of them is seen by both
    )
    assert verdict.control != "not ok"


def test_a_stall_alone_changes_no_status(run: RunData) -> None:
    sound = verdict_of(run)
    stalled = verdict_of(watched(run, account({500: 30.0}), (501.0, 30.0)))
    assert (stalled.control, stalled.reason) == (sound.control, sound.reason)
    assert stalled.losses() != [] == sound.losses()
