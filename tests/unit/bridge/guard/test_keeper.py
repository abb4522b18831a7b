"""The thread that writes and watches the state files of a rig."""

import threading
from pathlib import Path

import pytest

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


def test_a_stop_by_file_is_taken_once_and_confirmed_at_rest() -> None:
    made = keeper()
    made._look()
    assert made.stop_by_file() is None
    stops = order(HERE, "Ada")
    made.at_rest = True  # of the block before the stop
    made._look()
    assert not confirmed(stops, 0.0)
    assert (made.stop_by_file(), made.stop_by_file()) == ("Ada", None)
    made.at_rest = False
    made._look()
    assert not confirmed(stops, 0.0)
    made.at_rest = True
    made._look()
    assert confirmed(stops, 0.0)


def test_a_stop_of_an_earlier_run_is_confirmed_and_not_taken_again() -> None:
    StopLatch("lathe").set("Ada")
    made = keeper()
    made.at_rest = True
    made._look()
    assert made.stop_by_file() is None
    assert RigFile("lathe", HERE).confirmed_ns == StopLatch("lathe").set_ns


def test_the_newest_order_of_a_flood_is_kept_without_further_threads() -> None:
    made = keeper()
    threads = threading.active_count()
    for _ in range(1000):
        made.clear_stop()
        made.keep_stop("Ada")
    assert (len(made._waiting), threading.active_count()) == (1, threads)
    made._look()
    assert StopLatch("lathe").who() == "Ada"
    assert made.stop_by_file() is None  # it came over the bus
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
    assert made.stop_by_file() == "Ada"


def test_the_stop_of_a_run_ends_with_it_and_the_stop_of_a_rig_does_not() -> None:
    for outlasts in (True, False):
        latch = StopLatch("lathe", outlasts)
        made = Keeper(latch, RigFile("lathe", HERE))
        with made.running(1, print):
            made.keep_stop("Ada")
        assert (latch.is_set, order(HERE, "Ada")) == (outlasts, [])


def test_a_state_that_cannot_be_kept_is_reported(folder: Path) -> None:
    folder.parent.write_text("a file in the way")
    made = Keeper(StopLatch("lathe"), RigFile("lathe", HERE))
    lines: list[str] = []
    with made.running(1, lines.append):
        made.keep_stop("Ada")
    assert ["only over the bus" in lines[0], "does not outlast a restart" in lines[1]] == [True, True]
    assert "Not a directory" in lines[0]
