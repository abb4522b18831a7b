"""A stop by the operator outlasts the rig's process, for each rig separately."""

import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from bridge.guard.kept import StopLatch


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path / "state" / "stickslip"


def test_a_stop_is_kept_until_it_is_cleared() -> None:
    assert not StopLatch("lathe").is_set
    assert StopLatch("lathe").can_be_set() == ""
    StopLatch("lathe").set("Ada")
    assert StopLatch("lathe").is_set
    assert '"by": "Ada"' in StopLatch("lathe").path.read_text()
    StopLatch("lathe").clear()
    StopLatch("lathe").clear()
    assert not StopLatch("lathe").is_set


def test_rigs_do_not_share_a_stop() -> None:
    StopLatch("a/b").set("Ada")
    assert not StopLatch("a_b").is_set
    assert not StopLatch("lathe").is_set
    assert StopLatch("a/b").is_set


def test_the_folder_is_the_users_own(folder: Path) -> None:
    StopLatch("lathe").set("Ada")
    assert stat.S_IMODE(os.stat(folder).st_mode) == 0o700


def test_a_folder_that_cannot_be_made_is_reported(folder: Path) -> None:
    folder.parent.write_text("a file in the way")
    assert str(folder) in StopLatch("lathe").can_be_set()
    with pytest.raises(NotADirectoryError):
        StopLatch("lathe").set("Ada")


def test_a_full_disk_that_takes_names_and_no_content_is_reported(folder: Path) -> None:
    code = "from bridge.guard.kept import StopLatch; print(StopLatch('lathe').can_be_set())"
    full = ["sh", "-c", 'ulimit -f 0; exec "$@" | cat', "sh", sys.executable, "-c", code]
    assert subprocess.run(full, check=True, capture_output=True, text=True).stdout == f"{folder}: File too large\n"


def test_any_file_in_place_of_the_latch_counts_as_a_stop(folder: Path) -> None:
    latch = StopLatch("lathe")
    folder.mkdir(parents=True)
    latch.path.symlink_to("nowhere")
    assert latch.is_set


def test_a_folder_that_cannot_be_looked_into_holds_too(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_path: object) -> bool:
        raise PermissionError

    monkeypatch.setattr(os.path, "lexists", refuse)
    monkeypatch.setattr(Path, "lstat", refuse)
    assert (StopLatch("lathe").is_set, StopLatch("lathe").set_ns) == (True, 1)
