"""A file that a command would replace, and that is of another kind, stays; and a full disk is one line."""

import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from bridge.faults import FAULTS
from cockpit.cli import app
from tests.logs import short_log

RUN = ("run", "--in-process", "--set", "duration_s=0.05")


@pytest.fixture
def files(tmp_path: Path) -> dict[str, Path]:
    made = {name: tmp_path / name for name in ("run.mcap", "log.json", "plant.py", "rig.toml")}
    for name, path in made.items():
        path.write_bytes(short_log() if name in {"run.mcap", "log.json"} else b"mine = 1\n")
    return made


@pytest.mark.parametrize(
    ("words", "victim"),
    [
        ((*RUN, "--log", "plant.py"), "plant.py"),
        (("run", "--lockstep", "--log", "rig.toml"), "rig.toml"),
        (("replay", "run.mcap", "--closed-loop", "--log", "plant.py"), "plant.py"),
        (("log", "recover", "run.mcap", "--out", "plant.py"), "plant.py"),
        (("log", "info", "log.json", "--json", "log.json"), "log.json"),
        (("log", "check", "log.json", "--json", "log.json"), "log.json"),
    ],
)
def test_what_is_there_and_of_another_kind_stays(files, monkeypatch, words, victim):
    monkeypatch.chdir(files[victim].parent)
    before = files[victim].read_bytes()
    result = CliRunner().invoke(app, [*words])
    assert result.exit_code == FAULTS["CONFIG"].exit_status
    assert f"{victim} is there and is no" in result.output
    assert files[victim].read_bytes() == before


def test_a_log_is_not_replaced_by_the_result_of_its_run(tmp_path):
    log, other_name = tmp_path / "same.mcap", tmp_path / "other-name.json"
    other_name.symlink_to(log)
    result = CliRunner().invoke(app, [*RUN, "--log", str(log), "--json", str(other_name)])
    assert result.exit_code == FAULTS["CONFIG"].exit_status
    assert log.read_bytes().startswith(b"\x89MCAP")


@pytest.mark.parametrize("words", [("scenarios",), ("explain", "--json")])
def test_a_full_disk_is_one_line(words):
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "cockpit", *words], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert done.returncode == FAULTS["LOG_WRITE"].exit_status
    assert (
        done.stderr
        == "stickslip: LOG_WRITE: stdout: cannot be written: the disk is full; free space or write elsewhere\n"
    )


def test_a_closed_stdout_is_no_error():
    done = subprocess.run(
        ["sh", "-c", f"{sys.executable} -m cockpit scenarios >&-"], stderr=subprocess.PIPE, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
