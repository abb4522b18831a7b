"""A file that a command would replace, and that is of another kind, stays; and a full disk is one line."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from bridge.faults import FAULTS
from bridge.log.logfile import read_run
from cockpit.cli import app
from cockpit.run import run
from tests.logs import short_log

RUN = ("run", "--in-process", "--set", "duration_s=0.05")


@pytest.fixture
def files(tmp_path: Path) -> dict[str, Path]:
    names = ("run.mcap", "log.json", "plant.py", "rig.toml", "mine.png", "mine.html", "mine.csv", "mine.xlsx")
    made = {name: tmp_path / name for name in names}
    for name, path in made.items():
        path.write_bytes(short_log() if name in {"run.mcap", "log.json"} else b"mine = 1\n")
    made["through.csv"] = tmp_path / "through.csv"
    made["through.csv"].symlink_to("plant.py")
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
        (("plot", "run.mcap", "--out", "mine.png"), "mine.png"),
        (("review", "run.mcap", "--out", "mine.html"), "mine.html"),
        (("map", "--out", "mine.png"), "mine.png"),
        (("plot", "run.mcap", "--data", "mine.csv"), "mine.csv"),
        (("plot", "run.mcap", "--data", "through.csv"), "through.csv"),
        (("look", "run.mcap", "--out", "mine.csv"), "mine.csv"),
        (("look", "run.mcap", "--out", "mine.xlsx"), "mine.xlsx"),
    ],
)
def test_an_existing_file_of_another_kind_is_kept(files, monkeypatch, words, victim):
    monkeypatch.chdir(files[victim].parent)
    before = files[victim].read_bytes()
    result = CliRunner().invoke(app, [*words])
    assert result.exit_code == FAULTS["CONFIG"].exit_status
    assert f"{victim} exists and " in result.output
    assert "would be lost; choose another file" in result.output
    assert files[victim].read_bytes() == before


@pytest.mark.parametrize(
    ("words", "name"),
    [
        (("replay", "run.mcap", "--closed-loop", "--log", "link.mcap"), "link.mcap"),
        (("plot", "run.mcap", "--out", "link.png"), "link.png"),
        (("log", "export", "run.mcap", "--to", "link.csv", "--topic", "trace"), "link.csv"),
        (("log", "export", "run.mcap", "--to", "link.csv"), "link.trace.csv"),
    ],
)
def test_a_result_is_not_written_to_a_link_of_an_input(files, monkeypatch, words, name):
    log = files["run.mcap"]
    monkeypatch.chdir(log.parent)
    Path(name).hardlink_to(log)
    result = CliRunner().invoke(app, [*words])
    assert result.exit_code == FAULTS["CONFIG"].exit_status
    assert f"{name}: is " in result.output
    assert log.samefile(name)
    assert log.read_bytes() == short_log()


@pytest.mark.parametrize("name", ["run.mcap", "./run.mcap", "hard.mcap", "soft.mcap"])
def test_a_log_is_recovered_in_its_place_only_where_that_is_asked_for(files, monkeypatch, name):
    log = files["run.mcap"]
    monkeypatch.chdir(log.parent)
    Path("hard.mcap").hardlink_to(log)
    Path("soft.mcap").symlink_to(log)
    cut = log.read_bytes()[:-100]
    log.write_bytes(cut)
    result = CliRunner().invoke(app, ["log", "recover", "run.mcap", "--out", name])
    assert result.exit_code == FAULTS["CONFIG"].exit_status
    assert "would be replaced; use --in-place to replace it, or choose another" in result.output
    assert log.read_bytes() == cut
    assert CliRunner().invoke(app, ["log", "recover", "run.mcap", "--in-place"]).exit_code == 0
    assert log.read_bytes() != cut


def test_a_log_is_not_replaced_by_the_result_of_its_run(tmp_path):
    log, other_name = tmp_path / "same.mcap", tmp_path / "other-name.json"
    other_name.symlink_to(log)
    result = CliRunner().invoke(app, [*RUN, "--log", str(log), "--json", str(other_name)])
    assert result.exit_code == FAULTS["CONFIG"].exit_status
    assert log.read_bytes().startswith(b"\x89MCAP")


def test_a_run_without_an_end_leaves_room_on_the_disk_of_its_log(tmp_path, monkeypatch):
    log = tmp_path / "endless.mcap"
    words = ["run", "--in-process", "--scenario", "belt-axis", "--set", "duration_s=0", "--log", str(log)]
    free = [1 << 40, 1 << 40, 1 << 40, 5_000_000]
    monkeypatch.setattr(run, "_free_bytes", lambda _: free.pop(0) if len(free) > 1 else free[0])
    ended = CliRunner().invoke(app, [*words, "--json", str(tmp_path / "verdict.json")])
    line = f"LOG_WRITE: ended, as less than 1074 MB are free for {log}"
    assert f"warning  {line}" in ended.stdout
    assert line in json.loads((tmp_path / "verdict.json").read_text())["told"]
    assert 0 < len(read_run(log).sensors) < 10_000
    assert line in json.loads((tmp_path / "endless.verdict.json").read_text())["figures"]["told"]
    refused = CliRunner().invoke(app, words)
    assert refused.exit_code == FAULTS["LOG_WRITE"].exit_status
    assert "5 MB are free: " in refused.stderr
    assert "or give it an end: --set duration_s=60" in refused.stderr


@pytest.mark.parametrize(("where", "why"), [(">/dev/full", "No space left on device"), (">&-", "Bad file descriptor")])
@pytest.mark.parametrize("words", ["scenarios", "explain --json", "--version", "log --help"])
@pytest.mark.slow
def test_a_stdout_that_takes_nothing_is_one_line(words, where, why):
    done = _in_a_shell(f"-m cockpit {words} {where}")
    assert done.returncode == FAULTS["LOG_WRITE"].exit_status
    assert done.stderr == f"stickslip: LOG_WRITE: stdout: cannot be written: {why}; free space or write elsewhere\n"


@pytest.mark.slow
def test_stdout_escapes_characters_that_it_cannot_encode(tmp_path):
    (tmp_path / "ü.toml").write_bytes(b"")
    done = _in_a_shell(f"-m cockpit schema --out {tmp_path}/ü/ rig", PYTHONIOENCODING="ascii")
    assert (done.returncode, done.stdout) == (0, f"written  {tmp_path}/\\xfc/rig.json\n")


@pytest.mark.slow
def test_a_name_that_is_not_utf_8_is_written(files):
    folder = files["run.mcap"].parent
    done = _in_a_shell(
        f"-m cockpit log export {files['run.mcap']} --to {folder}/\"$(printf '\\377.csv')\" --topic trace"
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert b"\xff.csv" in os.listdir(os.fsencode(folder))


def test_a_table_that_is_there_is_not_replaced_unasked(files, monkeypatch):
    log = files["run.mcap"]
    monkeypatch.chdir(log.parent)
    Path("mine.csv").write_text("mine")
    words = ["log", "export", "run.mcap", "--to", "mine.csv", "--topic", "trace"]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == FAULTS["CONFIG"].exit_status
    assert "--to mine.csv: exists already, and would be lost; choose another name, or add --overwrite" in result.output
    assert Path("mine.csv").read_text() == "mine"
    assert CliRunner().invoke(app, [*words, "--overwrite"]).exit_code == 0
    assert Path("mine.csv").read_text().startswith('"t_s"')


@pytest.mark.slow
def test_a_picture_is_made_whatever_backend_the_environment_names(files):
    picture = files["run.mcap"].with_name("run.png")
    done = _in_a_shell(f"-m cockpit plot {files['run.mcap']}", MPLBACKEND="foo")
    assert (done.returncode, done.stdout) == (0, f"picture  {picture}\n")
    assert picture.read_bytes().startswith(b"\x89PNG")


def _in_a_shell(words: str, **environment: str):
    command = ["sh", "-c", f"{sys.executable} -P {words}"]
    return subprocess.run(command, capture_output=True, text=True, check=False, env=os.environ | environment)
