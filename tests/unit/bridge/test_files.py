"""Files are never written through a symbolic link or into a file of another user."""

import os
import stat
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bridge.faults import Fault
from bridge.files import Replacement, followed, replacing, write_whole
from bridge.log.recover import recover
from bridge.log.runlog import RunLog
from bridge.tables.export import export
from bridge.tables.writers import ArrowTable
from cockpit.figures.run_figure import draw_logs
from tests.logs import short_log


def log(folder: Path) -> Path:
    path = folder / "run.mcap"
    path.write_bytes(short_log())
    return path


def table(out: Path) -> None:
    writer = ArrowTable(out)
    writer.append({"t_s": np.arange(3.0)})
    writer.finish()


WRITERS: dict[str, Callable[[Path], object]] = {
    "page.html": lambda out: write_whole(out, "new"),
    "table.csv": table,
    "table.parquet": table,
    "all.mat": lambda out: export(log(out.parent), out, ["trace"], overwrite=True),
    "whole.mcap": lambda out: recover(log(out.parent), out),
    "plot.png": lambda out: draw_logs([log(out.parent)], out),
}


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.slow
def test_a_link_where_the_unfinished_file_used_to_be_is_left_alone(tmp_path: Path, name: str) -> None:
    victim = tmp_path / "victim"
    victim.write_text("precious")
    out = tmp_path / name
    for laid in (f"{name}.part", f".{name}.part", f"{name}.columns"):
        (tmp_path / laid).symlink_to(victim)
    WRITERS[name](out)
    assert out.is_file()
    assert victim.read_text() == "precious"
    assert not [entry for entry in os.listdir(tmp_path) if entry.endswith(".part") and entry.count(".") > 3]


@pytest.fixture
def of_somebody_else(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make all files look as if another user owned them."""
    real = os.geteuid()
    monkeypatch.setattr(os, "geteuid", lambda: real + 12345)
    if real == 0:  # root's links count as the system's own
        plain = Path.lstat
        seen = os.stat_result

        def lstat(self: Path) -> os.stat_result:
            fields = list(plain(self))
            fields[stat.ST_UID] = 54321
            return seen(fields)

        monkeypatch.setattr(Path, "lstat", lstat)


@pytest.mark.usefixtures("of_somebody_else")
@pytest.mark.parametrize("name", [*WRITERS, "log.mcap"])
def test_a_link_of_another_user_is_not_written_through(tmp_path: Path, name: str) -> None:
    victim = tmp_path / "victim"
    victim.write_bytes(short_log() if name.endswith(".mcap") else b"precious")
    before = victim.read_bytes()
    out = tmp_path / name
    out.symlink_to(victim)
    writer = WRITERS.get(name, lambda at: RunLog(at, lockstep=True))
    with pytest.raises(Fault, match=rf"LOG_WRITE: .*{name}: is a link of another user to .*victim: refused"):
        writer(out)
    assert victim.read_bytes() == before


def test_a_link_of_our_own_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    (tmp_path / "link").symlink_to("there/page.html")
    (tmp_path / "second").symlink_to("link")
    write_whole(tmp_path / "second", "new")
    assert (tmp_path / "there" / "page.html").read_text() == "new"
    assert (tmp_path / "second").is_symlink()
    (tmp_path / "round").symlink_to("round")
    assert followed(tmp_path / "round").name == "round"  # opening it reports the loop of links


def test_a_failed_write_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "page.html"
    path.write_text("old")

    def half_way() -> None:
        with replacing(path) as file:
            file.write(b"new")
            raise ValueError("half way")

    with pytest.raises(ValueError, match="half way"):
        half_way()
    assert path.read_text() == "old"
    new = Replacement(path)
    new.discard()
    new.discard()
    assert os.listdir(tmp_path) == ["page.html"]


def test_the_longest_name_can_be_written(tmp_path: Path) -> None:
    path = tmp_path / ("ü" * 120 + ".html")
    write_whole(path, "new")
    assert path.read_text() == "new"
