"""A stop without the bus: which rigs it stops, and the confirmation that counts."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from bridge.guard import kept, stop_file
from bridge.guard.kept import StopLatch
from bridge.guard.stop_file import RigFile, StopOrder, confirmed, order

HERE = "tcp/127.0.0.1:7447"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path / "state" / "stickslip"


def started(rig: str, endpoint: str = HERE) -> RigFile:
    made = RigFile(rig, endpoint)
    made.make(1)
    return made


def stopped(endpoint: str) -> list[str]:
    return [stop.rig for stop in order(endpoint, "Ada") if StopLatch(stop.rig).is_set]


@pytest.mark.parametrize(
    ("endpoint", "rigs"),
    [
        (HERE, ["lathe"]),
        ("tls/localhost:7447", ["lathe"]),
        ("tls/[::1]:7447", ["lathe"]),
        ("tcp/0.0.0.0:7448", ["mill"]),
        ("tcp/127.0.0.1:7449", []),
        ("tls/192.0.2.1:7447", []),  # an address of another computer
        ("tls/no-such-name.invalid:7447", ["lathe"]),  # its rig cannot be reached over the bus either
    ],
)
def test_a_stop_reaches_the_rig_at_its_port_of_this_computer(endpoint: str, rigs: list[str]) -> None:
    started("lathe")
    started("mill", "tls/0.0.0.0:7448")
    assert stopped(endpoint) == rigs
    assert [rig for rig in ("lathe", "mill") if StopLatch(rig).is_set] == rigs


def test_a_rig_that_does_not_confirm_is_waited_for_and_not_counted() -> None:
    started("lathe")
    stops = order(HERE, "Ada")
    assert stops
    assert not confirmed(stops, 0.05)
    assert not confirmed([], 0.05)


def test_a_name_server_that_does_not_answer_does_not_delay_a_stop(monkeypatch: pytest.MonkeyPatch) -> None:
    started("lathe")
    monkeypatch.setattr(stop_file, "_NAME_S", 0.01)
    monkeypatch.setattr(stop_file.socket, "getaddrinfo", lambda *_args, **_options: stop_file.time.sleep(0.1) or [])
    assert stopped("tls/rig.lab:7447") == ["lathe"]


def test_only_the_confirmation_of_this_stop_counts() -> None:
    rig = started("lathe")
    first = order(HERE, "Ada")
    assert not confirmed(first, 0.0)
    rig.confirm(first[0].latch.set_ns)
    assert confirmed(first, 0.0)
    second = order(HERE, "Ada")
    assert not confirmed(second, 0.0)
    rig.confirm(second[0].latch.set_ns)
    assert confirmed(second, 0.0)
    rig.remove()
    assert not confirmed(second, 0.0)
    assert not confirmed([], 0.0)


def test_a_stop_that_a_simultaneous_reset_removed_is_set_again() -> None:
    started("lathe")
    stops = order(HERE, "Ada")
    StopLatch("lathe").clear()
    assert not confirmed(stops, 0.0)
    assert StopLatch("lathe").is_set


def test_on_a_full_disk_an_empty_file_is_a_stop(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = started("lathe")

    def full(*_args: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(kept, "write_whole", full)
    stops = order(HERE, "Ada")
    assert (stops[0].problem, StopLatch("lathe").is_set, StopLatch("lathe").who()) == ("", True, "")
    rig.confirm(StopLatch("lathe").set_ns)
    assert confirmed(stops, 0.0)


def test_a_stop_that_cannot_be_set_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = started("lathe")

    def full(*_args: Any, **_options: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(kept, "write_whole", full)
    monkeypatch.setattr(Path, "touch", full)
    stop = StopOrder(rig, "Ada")
    assert stop.problem.endswith("No space left on device")
    assert not confirmed([stop], 0.0)


@pytest.mark.parametrize(("name", "endpoint"), [("mill", HERE), ("lathe", "tcp/127.0.0.1:7448")])
def test_a_rig_that_starts_removes_the_files_of_ended_rigs_of_its_port_or_name(
    name: str, endpoint: str, folder: Path
) -> None:
    ended = started("lathe")
    child = subprocess.Popen([sys.executable, "-S", "-c", ""])
    child.wait()
    ended.path.write_text(ended.path.read_text().replace(f'"process": {os.getpid()}', f'"process": {child.pid}'))
    (folder / "rig-damaged.json").write_text("[1")
    (folder / "rig-other.json").write_text('{"latch": 1, "endpoint": "", "process": 1}')
    started(name, endpoint)
    assert (stopped(endpoint), ended.exists) == ([name], False)


def test_a_rig_sees_a_running_rig_of_its_name_and_no_ended_one() -> None:
    other, rig = started("lathe", "tcp/127.0.0.1:7448"), started("lathe")
    started("mill", "tcp/127.0.0.1:7450")
    assert rig.namesake == "tcp/127.0.0.1:7448"
    text = other.path.read_text()
    table = json.loads(text)
    # the same process number after a start of the computer
    other.path.write_text(text.replace(f'"started": {table["started"]}', f'"started": {table["started"] + 1}'))
    assert rig.namesake == ""
