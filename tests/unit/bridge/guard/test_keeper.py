"""The thread that writes and watches the state files of a rig."""

import shutil
import threading
from pathlib import Path
from typing import Any

import pytest

from bridge.guard import kept
from bridge.guard.keeper import Keeper
from bridge.guard.kept import StopLatch
from bridge.guard.stop_file import RigFile, confirmed, order

HERE = "tcp/127.0.0.1:7447"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path / "state" / "stickslip"


def keeper() -> Keeper:
    rig = RigFile("lathe", HERE)
    rig.make(1)
    return Keeper(StopLatch("lathe"), rig)


def test_a_stop_by_file_holds_and_is_confirmed_at_rest() -> None:
    made = keeper()
    made._look()
    assert made.holder is None
    stops = order(HERE, "Ada")
    made._look()
    assert made.holder == "Ada"
    made._look()
    assert (made.holder, confirmed(stops, 0.0)) == ("Ada", False)
    made.at_rest = True
    made._look()
    assert confirmed(stops, 0.0)


def test_a_stop_of_an_earlier_run_holds_and_is_confirmed() -> None:
    StopLatch("lathe").set("Ada")
    made = keeper()
    made.at_rest = True
    made._look()
    assert made.holder == "Ada"
    assert RigFile("lathe", HERE).confirmed_ns == StopLatch("lathe").set_ns


def test_a_reset_ends_a_stop_before_its_file_is_removed_and_where_it_cannot_be(monkeypatch: pytest.MonkeyPatch) -> None:
    made, lines = keeper(), []
    order(HERE, "Ada")
    made._look()
    made.clear_stop()
    assert made.holder is None
    made._look()
    assert (made.holder, StopLatch("lathe").is_set) == (None, False)
    order(HERE, "Ada")
    made._look()

    def refuse(_latch: StopLatch) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(StopLatch, "clear", refuse)
    monkeypatch.setattr(made, "_report", lines.append)
    made.clear_stop()
    made._look()
    made._look()
    assert (made.holder, StopLatch("lathe").is_set, len(lines)) == (None, True, 1)


def test_a_rig_whose_files_are_removed_makes_them_again(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made, lines = keeper(), []
    monkeypatch.setattr(made, "_report", lines.append)
    order(HERE, "Ada")
    made.at_rest = True
    made._look()
    shutil.rmtree(folder)
    for _ in range(100):
        made._look()
    assert (StopLatch("lathe").who(), "is made again" in lines[0], len(lines)) == ("the rig", True, 1)
    stops = order(HERE, "Ada")
    made.rig.remove()
    made._look()
    assert (confirmed(stops, 0.0), "no confirmation by file" in lines[1]) == (False, True)
    for _ in range(100):
        made._look()
    assert confirmed(stops, 0.0)


def test_a_rig_without_room_for_its_file_reports_it_at_each_stop_and_makes_it_later(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def full(*_args: Any) -> None:
        raise OSError(28, "No space left on device")

    made, lines = Keeper(StopLatch("lathe"), RigFile("lathe", HERE)), []
    monkeypatch.setattr(kept, "write_whole", full)
    with made.running(1, lines.append):
        assert ("only over the bus" in made.problem, lines) == (True, [])
        made._keep_files()
        assert lines == []  # the same problem
        made._set_latch("Ada")
        assert lines == [made.problem]
        monkeypatch.undo()
        monkeypatch.setenv("XDG_STATE_HOME", str(made.latch.path.parents[1]))
        made._keep_files()
        assert (made.problem, "is made again" in lines[-1]) == ("", True)
        assert [stop.rig for stop in order(HERE, "Ada")] == ["lathe"]


def test_a_latch_that_could_not_be_set_is_set_once_the_disk_has_room(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_args: Any, **_options: Any) -> None:
        raise OSError(28, "No space left on device")

    made, lines = keeper(), []
    monkeypatch.setattr(made, "_report", lines.append)
    with monkeypatch.context() as patch:
        patch.setattr(StopLatch, "set", full)
        made.keep_stop("Ada")
        made._look()
        made.at_rest = True
        made._keep_files()
        assert ("does not outlast a restart" in made.problem, len(lines)) == (True, 2)
        made.clear_stop()
        made._keep_files()
        assert (made.problem, len(lines)) == ("", 2)  # no stop holds, and nothing was made
    made.at_rest = True
    made._keep_files()
    assert StopLatch("lathe").is_set


def test_the_newest_order_of_a_flood_is_kept_without_further_threads() -> None:
    made = keeper()
    threads = threading.active_count()
    for _ in range(1000):
        made.clear_stop()
        made.keep_stop("Ada")
    assert (len(made._waiting), threading.active_count()) == (1, threads)
    made._look()
    assert StopLatch("lathe").who() == "Ada"
    assert made.holder == "Ada"
    made.keep_stop("Ada")
    made.clear_stop()
    made._look()
    assert not StopLatch("lathe").is_set


def test_a_stop_by_file_wins_over_a_reset_that_waits() -> None:
    made = keeper()
    made.clear_stop()
    order(HERE, "Ada")
    made._look()
    assert StopLatch("lathe").is_set
    assert made.holder == "Ada"


def test_the_stop_of_a_run_ends_with_it_and_the_stop_of_a_rig_does_not() -> None:
    for outlasts in (True, False):
        latch = StopLatch("lathe", outlasts)
        made = Keeper(latch, RigFile("lathe", HERE))
        with made.running(1, print):
            made.keep_stop("Ada")
        assert latch.is_set == outlasts
        latch.clear()
        assert [stop.rig for stop in order(HERE, "Ada")] == ["lathe"] * outlasts  # it may start again
        assert latch.is_set == outlasts


def test_a_state_that_cannot_be_kept_is_reported(folder: Path) -> None:
    folder.parent.write_text("a file in the way")
    made = Keeper(StopLatch("lathe"), RigFile("lathe", HERE))
    lines: list[str] = []
    with made.running(1, lines.append):
        assert "Not a directory: this rig takes no stop by file" in made.problem
        made.keep_stop("Ada")
    assert ["does not outlast a restart" in line for line in lines] == [True]
