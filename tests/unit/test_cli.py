"""Commands that read a log or draw: what comes of logs and options that are not as usual."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from cockpit.cli import app
from tests.logs import empty_log, short_log

PNG = b"\x89PNG"


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "run.mcap"
    path.write_bytes(short_log())
    return path


def call(*arguments: str):
    return CliRunner().invoke(app, list(arguments))


def test_a_log_without_a_block_is_drawn(tmp_path: Path) -> None:
    out = tmp_path / "run.png"
    result = call("plot", str(empty_log(tmp_path)), "--out", str(out))
    assert result.exit_code == 0, result.output
    assert out.read_bytes().startswith(PNG)


def test_a_picture_of_another_name_is_a_png_and_a_run_without_vibration_has_no_legend_of_it(log: Path) -> None:
    out = log.with_name("run.foo")
    result = call("plot", str(log), "--out", str(out))
    assert result.exit_code == 0, result.output
    assert out.read_bytes().startswith(PNG)


@pytest.mark.parametrize("time", ["inf", "nan", "-1s", "1e300s", "soon"])
def test_what_is_no_time_is_refused(log: Path, time: str) -> None:
    for option in (f"--from={time}", f"--set=limits.v_ratio=1.1@{time}"):
        result = call("replay", str(log), option)
        assert result.exit_code == 2, result.output
        assert f"{time!r} is no time; must be from 0 to 1e+09 s" in result.stderr


@pytest.mark.parametrize("command", ["plot", "map", "reproduce"])
def test_a_folder_as_the_file_to_write_is_refused_at_once(log: Path, command: str) -> None:
    more = [str(log)] if command == "plot" else []
    result = call(command, *more, "--out", str(log.parent))
    assert result.exit_code == 5
    assert result.stderr.startswith(f"stickslip: LOG_WRITE: --out {log.parent}: is a folder; ")
    under_a_file = log / "picture"
    assert f"{under_a_file}: cannot be written" in call(command, *more, "--out", str(under_a_file)).stderr


def test_a_rig_that_cannot_be_read_is_no_picture_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").mkdir()
    result = call("map", "--rig", str(tmp_path / "mine.toml"), "--out", str(tmp_path / "map.png"))
    assert result.exit_code != 0
    assert "LOG_WRITE" not in result.output
