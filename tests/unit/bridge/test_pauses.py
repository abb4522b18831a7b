"""Stalls of the computer: when several cores stall together, the times of the events, and the start and end of the timers."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterable
from pathlib import Path

import pytest

from bridge.log.logfile import read_run
from bridge.log.pause_writer import PauseWriter, RunClock
from bridge.log.runlog import RunLog
from bridge.log.watches.event_watch import CORE_PAUSE, EventWatch, RunPause, pauses_of
from bridge.wire import core_timer, pauses, realtime
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import APPLIED as APPLIED_LAYOUT
from bridge.wire.pauses import NO_PRIORITY, Pause, PauseWatch, settled, shared
from bridge.wire.topics import APPLIED
from bridge.wire.zenoh_link import Received
from tests.patience import PATIENCE_S
from tests.system.run_under_way import gone

MS = 1_000_000
needs_priority = pytest.mark.skipif(not realtime.may_claim(), reason="no real-time priority here")


def not_watched(events: Iterable[wire.Event]) -> str:
    watch = EventWatch()
    watch.add(events)
    return watch.not_watched


def still(*stretches: tuple[int, int]) -> list[Pause]:
    return [Pause(*stretch) for stretch in stretches]


@pytest.mark.parametrize(
    ("cores", "expected"),
    [
        ([still((0, 10)), still((2, 12))], still((2, 10))),
        ([still((0, 10)), still((10, 20))], []),
        ([still((0, 10), (30, 40)), still()], []),
        ([still((0, 20)), still((0, 5), (8, 30))], still((0, 5), (8, 20))),
        ([still((0, 9), (20, 29)), still((1, 8), (21, 35)), still((2, 22))], still((2, 8), (21, 22))),
        ([still((3, 4))], still((3, 4))),
        ([], []),
    ],
)
def test_only_a_pause_of_all_cores_is_a_pause_of_the_computer(cores: list[list[Pause]], expected: list[Pause]) -> None:
    assert shared(cores) == expected
    assert shared(cores[::-1]) == expected


def test_a_pause_is_reported_once_however_often_it_is_polled() -> None:
    pauses_by_core = {0: still((0, 20 * MS)), 1: still((0, 5 * MS), (8 * MS, 30 * MS))}
    first, pauses_by_core = settled(pauses_by_core, 6 * MS)
    second, pauses_by_core = settled(pauses_by_core, 40 * MS)
    alone = [Pause(5 * MS, 8 * MS, core=0), Pause(20 * MS, 30 * MS, core=1)]
    assert (first, second) == (still((0, 5 * MS)), [alone[0], Pause(8 * MS, 20 * MS), alone[1]])
    assert settled(pauses_by_core, 100 * MS)[0] == []


def test_a_pause_of_one_core_is_reported_for_that_core() -> None:
    cores = {2: still((0, 3 * MS), (10 * MS, 20 * MS)), 5: still((10 * MS, 20 * MS + 1), (40 * MS, 50 * MS))}
    pauses, later = settled(cores, 60 * MS)
    assert pauses == [Pause(0, 3 * MS, core=2), Pause(10 * MS, 20 * MS), Pause(40 * MS, 50 * MS, core=5)]
    assert later == {2: [], 5: []}


def test_a_thread_that_waited_for_another_saw_no_pause() -> None:
    due_ns, woke_ns = 100 * MS, 150 * MS
    assert core_timer.stall_end_ns(due_ns, woke_ns, waited_ns=0) == woke_ns
    assert core_timer.stall_end_ns(due_ns, woke_ns, waited_ns=30 * MS) == 120 * MS
    assert core_timer.stall_end_ns(due_ns, woke_ns, waited_ns=woke_ns - due_ns) == 0
    assert core_timer.stall_end_ns(due_ns, due_ns + core_timer.LEAST_NS, waited_ns=0) == 0


def test_the_clock_of_a_run_goes_by_the_message_that_was_delayed_least() -> None:
    clock = RunClock()
    assert clock.run_ns(0) is None
    for block in range(3000):  # the run began at 500 ms, its messages take 0.1 to 0.9 ms
        clock.note(500 * MS + block * MS + (100_000 + 1000 * (block * 7919 % 800)), block * MS)
    assert clock.run_ns(2600 * MS) == pytest.approx(2100 * MS, abs=0.11 * MS)
    clock.note(9000 * MS, 3000 * MS)  # the plant paused and restarted its clock
    clock.note(10_001 * MS, 4000 * MS)
    clock.note(11_002 * MS, 5000 * MS)
    assert clock.run_ns(11_000 * MS) == pytest.approx(5000 * MS, abs=2 * MS)


class FakeWatch:
    def __init__(self, *pauses: list[Pause]) -> None:
        self.cores, self.refused, self._told = [0, 1], "", list(pauses)

    def poll(self, all_of_them: bool = False) -> list[Pause]:  # noqa: ARG002
        return self._told.pop(0) if self._told else []


def applied(number: int, arrival_ns: int) -> Received:
    record = APPLIED_LAYOUT.blank()
    record["sequence"], record["t_ns"] = number, (number + 1) * MS
    return Received(APPLIED, record.tobytes(), arrival_ns)


def test_a_log_holds_pauses_in_the_time_of_its_run(tmp_path: Path) -> None:
    sent: list[wire.Event] = []
    watch = FakeWatch([], [*still((7 * MS, 9 * MS)), Pause(9 * MS, 12 * MS, core=1)])
    log = RunLog(tmp_path / "run.mcap", lockstep=False, on_event=sent.append)
    writer = PauseWriter(log, watch)  # pyright: ignore[reportArgumentType]
    began_ns = 5 * MS
    for number in range(11):
        received = applied(number, began_ns + (number + 1) * MS)
        log.write(APPLIED, received.payload)
        writer.note(received)
    writer.finish()
    log.close()
    events = read_run(log.path).events
    assert pauses_of(events) == [RunPause(2 * MS, 4 * MS)]
    assert not_watched(events) == ""
    assert pauses_of(events, CORE_PAUSE) == [RunPause(4 * MS, 7 * MS)]
    assert [event.code for event in events] == ["WATCH", "PAUSE", "CORE_PAUSE"]
    assert sent == events


def test_a_watch_that_is_refused_or_ends_is_reported_and_no_pause_is_claimed(tmp_path: Path) -> None:
    log, watch = RunLog(tmp_path / "run.mcap", lockstep=False), FakeWatch([], still((7 * MS, 9 * MS)))
    writer = PauseWriter(log, watch)  # pyright: ignore[reportArgumentType]
    writer.report_when_due()
    watch.refused = "a timer ended"
    writer.finish()
    log.close()
    events = read_run(log.path).events
    assert not_watched(events) == "a timer ended"
    assert events[-1].text == "stalls of the computer not watched: a timer ended"


def test_without_a_priority_nothing_is_watched(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(realtime, "may_claim", lambda _priority: False)
    watch = PauseWatch()
    assert (watch.refused, watch.poll()) == (NO_PRIORITY, [])
    watch.close()


def _hold(timers: list["subprocess.Popen[bytes]"], seconds: float) -> None:
    for timer in timers:
        timer.send_signal(signal.SIGSTOP)
    time.sleep(seconds)
    for timer in timers:
        timer.send_signal(signal.SIGCONT)


def _wait_until_they_watch(timers: Iterable[int]) -> None:
    """Until each has its priority, as it has its handlers of signals by then and begins to look."""
    until_s = time.monotonic() + PATIENCE_S  # of normal priority until then: seconds on a busy computer
    waiting = list(timers)
    while waiting and time.monotonic() < until_s:
        time.sleep(0.01)
        waiting = [pid for pid in waiting if os.sched_getscheduler(pid) != os.SCHED_FIFO]
    assert not waiting, "timers that never began to watch"
    time.sleep(0.05)  # its priority is the last that a timer takes before it looks


@pytest.mark.realtime
@needs_priority
def test_a_pause_needs_all_timers_to_stall_together() -> None:
    watch = PauseWatch()
    try:
        assert watch.refused == ""
        _wait_until_they_watch(timer.pid for timer in watch._timers)
        _hold(watch._timers[:1], 0.2)
        time.sleep(0.2)
        if len(watch.cores) > 1:  # the machine itself may pause in this time, but not for as long
            assert {pause.core for pause in watch.poll() if pause.until_ns - pause.from_ns > 100 * MS} == {
                watch.cores[0]
            }
        began_ns = time.perf_counter_ns()
        _hold(watch._timers, 0.2)
        time.sleep(0.2)
        pauses = [pause for pause in watch.poll() if pause.until_ns - pause.from_ns > 100 * MS]
        assert [pause.core for pause in pauses] == [None]
        assert began_ns < pauses[0].from_ns + 5 * MS
        assert pauses[0].until_ns < time.perf_counter_ns()
        watch._timers[0].kill()
        watch._timers[0].wait()
        watch.poll()
        assert watch.refused == "a timer ended"
    finally:
        timers = [timer.pid for timer in watch._timers]
        watch.close()
    assert all(gone(pid) for pid in timers)


@pytest.mark.realtime
@needs_priority
def test_timers_end_with_a_process_that_is_killed() -> None:
    code = (
        "import time; from bridge.wire.pauses import PauseWatch; watch = PauseWatch(); "
        "print(*(timer.pid for timer in watch._timers), flush=True); time.sleep(60)"
    )
    parent = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    with parent.stdout:
        timers = [int(word) for word in parent.stdout.readline().split()]
    assert timers
    _wait_until_they_watch(timers)
    os.kill(timers[0], signal.SIGINT)  # Ctrl-C is for the recorder
    time.sleep(0.1)
    assert not gone(timers[0])
    parent.kill()
    parent.wait()
    until_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < until_s and not all(gone(pid) for pid in timers):
        time.sleep(0.02)
    assert all(gone(pid) for pid in timers)


def test_every_timer_is_above_the_loop() -> None:
    assert pauses._PRIORITY > realtime.LOOP_PRIORITY
