"""Commands that read a log or draw, with unusual logs and options."""

import json
import os
import subprocess
import sys
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from typer.testing import CliRunner

from bridge.faults import FAULTS, Fault
from bridge.log.logfile import read_run
from bridge.log.runlog import RunLog
from bridge.wire import stickslip_pb2 as wire
from cockpit.cli import _PANELS, app
from cockpit.commands.as_json.schemas import FORMATS
from cockpit.run.processes import progress_line
from cockpit.run.run import keep_aside
from cockpit.run.scenario import load_scenario
from tests.logs import doctored, short_log, verdict_of
from tests.patience import PATIENCE_S

PNG = b"\x89PNG"


def call(*arguments: str):
    return CliRunner().invoke(app, list(arguments))


@pytest.mark.parametrize(
    ("command", "suffix", "begins"),
    [
        ("plot", ".png", PNG),
        ("plot", ".PNG", PNG),
        ("plot", ".svg", b"<?xml"),
        ("plot", ".pdf", b"%PDF"),
        pytest.param("map", ".svg", b"<?xml", marks=[pytest.mark.slow, pytest.mark.nightly]),
    ],
)
def test_a_picture_has_the_format_of_its_suffix(log: Path, command: str, suffix: str, begins: bytes) -> None:
    out = log.with_name(f"picture{suffix}")
    result = call(command, *([str(log)] if command == "plot" else []), "--out", str(out))
    assert result.exit_code == 0, result.output
    assert out.read_bytes().startswith(begins)


@pytest.mark.parametrize("command", ["plot", "map"])
@pytest.mark.parametrize("name", ["run.foo", "run", "run.jpg"])
def test_a_picture_of_another_kind_is_refused(log: Path, command: str, name: str) -> None:
    out = log.with_name(name)
    result = call(command, *([str(log)] if command == "plot" else []), "--out", str(out))
    assert result.exit_code == 2
    assert f"--out {out}: must end in .png, .svg, .pdf; choose another name" in result.stderr
    assert not out.exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["diagnose", ".", "--report", "r.pdf"], "--report r.pdf: must end in .html, .htm; "),
        (["diagnose", ".", "--apply", "r.json"], "--apply r.json: must end in .toml; "),
        (
            ["diagnose", ".", "..", "--report", "r.html"],
            "--report r.html: must be a folder, but .html is a suffix of files",
        ),
        (["reproduce", "--out", "r.pdf"], "--out r.pdf: must end in .html, .htm; "),
        (["run", "--log", "r.csv"], "--log r.csv: must end in .mcap; "),
        (["record", "--log", "r.csv"], "--log r.csv: must end in .mcap; "),
        (["replay", "a.mcap", "--closed-loop", "--log", "r.csv"], "--log r.csv: must end in .mcap; "),
        (["log", "recover", "a.mcap", "--out", "r.csv"], "--out r.csv: must end in .mcap; "),
        (["log", "export", "a.mcap", "--to", "r.txt"], "--to r.txt: must end in .parquet, .csv, .mat; "),
        (
            ["log", "import", "a.csv", "--map", "m.toml", "--out", "r.csv"],
            "--out r.csv: must be a folder, but .csv is a suffix",
        ),
        (["schema", "--out", "r.json"], "--out r.json: must be a folder, but .json is a suffix of files; "),
        (["example", "r.toml"], "FOLDER r.toml: must be a folder, but .toml is a suffix of files; "),
    ],
)
def test_an_output_of_the_wrong_suffix_is_refused_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[str], message: str
) -> None:
    monkeypatch.chdir(tmp_path)
    result = call(*words)
    assert result.exit_code == 2
    assert result.stderr.startswith(f"stickslip: CONFIG: {message}")
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_picture_without_a_name_is_written_next_to_its_log(log: Path) -> None:
    result = call("plot", str(log))
    assert result.exit_code == 0, result.output
    assert log.with_name("run.png").read_bytes().startswith(PNG)


def test_a_folder_has_no_picture() -> None:
    result = call("plot", ".")
    assert result.exit_code == 7, result.output
    assert ".: is a folder, must be a file" in result.stderr


def test_a_picture_never_replaces_its_log(log: Path) -> None:
    before = log.read_bytes()
    result = call("plot", str(log), "--out", str(log))
    assert result.exit_code == 2, result.output
    assert f"--out {log}: is the log" in result.stderr
    assert log.read_bytes() == before


@pytest.mark.parametrize("time", ["inf", "nan", "-1s", "1e300s", "soon"])
def test_an_invalid_time_is_refused(log: Path, time: str) -> None:
    for option in (f"--from={time}", f"--set=limits.v_ratio=1.1@{time}"):
        result = call("replay", str(log), option)
        assert result.exit_code == 2, result.output
        assert f"{time!r} is not a time; must be from 0 to 1e+09 s" in result.stderr


@pytest.mark.parametrize("command", ["plot", "map", "reproduce"])
def test_a_folder_as_the_file_to_write_is_refused_at_once(log: Path, command: str) -> None:
    more = [str(log)] if command == "plot" else []
    suffix = ".html" if command == "reproduce" else ".png"
    folder = log.with_name(f"folder{suffix}")
    folder.mkdir()
    result = call(command, *more, "--out", str(folder))
    assert result.exit_code == 2
    assert result.stderr.startswith(f"stickslip: CONFIG: --out {folder}: must be a file, not a folder; ")
    under_a_file = log / f"picture{suffix}"
    assert f"{under_a_file}: cannot be written" in call(command, *more, "--out", str(under_a_file)).stderr
    long = log.parent / f"{'x' * 300}{suffix}"
    assert f"{long}: cannot be written: File name too long" in call(command, *more, "--out", str(long)).stderr


def test_a_rig_that_cannot_be_read_is_not_reported_as_a_write_error(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").mkdir()
    result = call("map", "--rig", str(tmp_path / "mine.toml"), "--out", str(tmp_path / "map.png"))
    assert result.exit_code != 0
    assert "LOG_WRITE" not in result.output


@pytest.mark.parametrize(
    ("options", "place", "remedy"),
    [
        (["--to-bus", "--closed-loop"], "--closed-loop: not with --to-bus", "leave one"),
        (["--to-bus", "--json"], "--json: not with --to-bus", "leave one"),
        (["--to-bus", "--set", "limits.v_ratio=1.1"], "--set: not with --to-bus", "leave one"),
        (["--to-bus", "--log", "new.mcap"], "--log: only with --closed-loop", "leave it out"),
        (["--speed", "1.0"], "--speed: only with --to-bus", "leave it out"),
        (["--all"], "--all: only with --to-bus", "leave it out"),
        (["--closed-loop", "--wait"], "--wait: only with --to-bus", "leave it out"),
        (["--endpoint", "tcp/127.0.0.1:7448"], "--endpoint: only with --to-bus", "leave it out"),
        (["--prefix", "hall"], "--prefix: only with --to-bus", "leave it out"),
        (["--log", "new.mcap"], "--log: only with --closed-loop", "leave it out"),
        (["--closed-loop", "--from", "0.1s"], "--from 0.1s: not with --closed-loop", "leave it out"),
        (["--closed-loop", "--log", "{log}"], "--log {log}: is the recorded run", "choose another"),
    ],
)
def test_options_that_a_replay_would_not_follow_are_refused(
    log: Path, options: list[str], place: str, remedy: str
) -> None:
    before = log.read_bytes()
    result = call("replay", str(log), *(option.format(log=log) for option in options))
    assert log.read_bytes() == before
    words = result.output + result.stderr
    assert result.exit_code == 2, words
    assert place.format(log=log) in words
    assert remedy in words


def test_results_from_a_damaged_log_carry_a_warning(log: Path, tmp_path: Path) -> None:
    data = bytearray(short_log())
    data[data.index(b"zstd", len(data) // 2) + 100] ^= 0x40
    log.write_bytes(data)
    replay, export = (
        ("replay", str(log)),
        ("log", "export", str(log), "--topic", "trace", "--to", str(tmp_path / "a.csv")),
    )
    for words, warning in (
        (replay, "warning: damaged: 1 chunk is damaged"),
        (export, "lost: 1 damaged chunk, 160 messages in its statistics, but not read\n"),
    ):
        output = call(*words)
        assert output.exit_code == 1
        assert warning in output.stdout
    [replayed] = json.loads(call(*replay, "--json").stdout)
    assert replayed["identical"]
    assert replayed["skipped_steps"] > 0
    assert replayed["damage"][0].startswith("damaged: 1 chunk is")


def test_a_log_that_needs_too_much_memory_is_one_line(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise MemoryError

    monkeypatch.setattr("cockpit.judge.judged.judge_log", full)
    monkeypatch.setattr(sys, "argv", ["stickslip", "log", "info", str(log)])
    output = call("log", "info", str(log))
    assert output.exit_code == FAULTS["NO_MEMORY"].exit_status
    assert output.stderr.startswith(f"stickslip: NO_MEMORY: {log}: needs more memory than is free; ")


def test_export_takes_times_as_replay_does(log: Path, tmp_path: Path) -> None:
    cut = ["log", "export", str(log), "--to", str(tmp_path / "a.csv"), "--topic", "trace", "--json"]
    result = call(*cut, "--from", "0.1s", "--until", "0.2")
    assert json.loads(result.stdout)["rows"] == {"trace": 100}
    assert "--from soon: 'soon' is not a time" in call(*cut, "--from", "soon").stdout


def test_a_log_that_is_being_recorded_is_not_renamed(tmp_path: Path) -> None:
    log = RunLog(tmp_path / "run.mcap", lockstep=True)
    with pytest.raises(Fault, match=r"LOG_WRITE: .*run.mcap: is being recorded: .*or give another --log"):
        keep_aside(log.path)
    log.close()


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["run", "--scenario", "deploy/rigs/paper-c45-c45.toml"], "is a rig, not a scenario; give it with --rig"),
        (["run", "--rig", "deploy/scenarios/stop-and-go.toml"], "is a scenario, not a rig; give the rig that it names"),
    ],
)
def test_a_rig_given_as_a_scenario_is_reported(arguments: list[str], expected: str) -> None:
    result = call(*arguments)
    assert result.exit_code == 2
    assert expected in result.stderr


def test_a_controller_configuration_that_lacks_a_key_of_the_verdict_is_a_bad_log(tmp_path: Path) -> None:
    run = read_run(doctored(tmp_path, lambda _tables: None))
    bare = run._replace(headers=run.headers | {"controller": {"configuration": '{"block_s": 0.001}'}})
    with pytest.raises(
        Fault, match=r"BAD_LOG: .*configuration of the controller: must hold policy.enabled_from_s as a number"
    ):
        verdict_of(bare)


def test_a_log_that_is_there_is_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "run.mcap"
    keep_aside(log)
    for what in (b"first", b"second"):
        log.write_bytes(what)
        os.utime(log, (1.7e9, 1.7e9))
        keep_aside(log)
        assert not log.exists()
    kept = {path.read_bytes(): str(path) for path in tmp_path.iterdir()}
    output = capsys.readouterr().err
    assert kept.keys() == {b"first", b"second"}
    assert all(path in output for path in kept.values())


@pytest.mark.parametrize("from_block", [0, 100])
def test_a_force_of_nan_gives_a_verdict_without_an_error(tmp_path: Path, from_block: int) -> None:
    def spoil(tables):
        tables["sensors"]["drive_force_N"][from_block:] = np.nan

    verdict = verdict_of(read_run(doctored(tmp_path, spoil)))
    assert (verdict.before is None) == (from_block == 0)
    assert verdict.before is None or np.isfinite(verdict.before.swing_N)
    assert not verdict.good


def test_messages_out_of_order_are_not_lost(tmp_path: Path) -> None:
    def exchange(tables):
        for name in ("sensors", "applied", "command", "trace", "state"):
            tables[name][[0, 30]] = tables[name][[30, 0]]

    verdict = verdict_of(read_run(doctored(tmp_path, exchange)))
    assert (verdict.lost_blocks, verdict.lost_messages) == (0, 0)


@pytest.mark.parametrize("arguments", [["log", "check", "bad.mcap"], ["explain"], ["explain", "CONFIG"], ["scenarios"]])
@pytest.mark.slow
def test_a_closed_pipe_is_not_a_success(tmp_path: Path, arguments: list[str]) -> None:
    """`stickslip ... | head` with a reader that has closed the pipe before the first output."""
    (tmp_path / "bad.mcap").write_bytes(short_log()[:-2000])
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer, "w") as closed:
        command = [sys.executable, "-m", "cockpit", *arguments]
        result = subprocess.run(command, stdout=closed, stderr=subprocess.PIPE, text=True, cwd=tmp_path, check=False)
    assert result.returncode == 141
    assert result.stderr == ""


def test_the_progress_line_has_a_bar_only_where_an_end_is_known() -> None:
    state = wire.State(t_ns=4_000_000_000, drive_force_N=12.0)
    assert "  4.0 s [#####               ] " in progress_line(state, 16.0)
    assert "[" not in progress_line(state, 0.0)
    assert progress_line(state, 0.0).startswith("   4.0 s ")


def test_without_a_command_four_lines_name_where_to_begin() -> None:
    result = call()
    assert result.exit_code == 2
    lines = result.stdout.splitlines()
    assert len(lines) == 4
    assert all(line.startswith("stickslip ") for line in lines)


def test_the_help_has_five_panels_and_types_in_words() -> None:
    text = call("--help").stdout
    assert [panel for panel in ("Try it", "My axis", "Rig", "Logs", "Proof") if f"─ {panel} ─" in text] == [*_PANELS]
    assert "<str>" not in call("plot", "--help").stdout


def test_a_shipped_scenario_is_copied_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert call("scenarios", "--copy", "stop-and-go").exit_code == 0
    copied = load_scenario("stop-and-go.toml", [])
    assert copied == load_scenario("stop-and-go", [])
    Path("stop-and-go.toml").write_text("mine")
    assert call("scenarios", "--copy", "stop-and-go").exit_code == 2
    assert Path("stop-and-go.toml").read_text() == "mine"


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        ("run --scenario bel", "belt-axis"),
        ("fault force-tenth", "force-tenth"),
        ("explain PIEZO_W", "PIEZO_WEAK"),
    ],
)
def test_a_shell_completes_names(words: str, offered: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in (("_STICKSLIP_COMPLETE", "complete_bash"), ("COMP_WORDS", f"stickslip {words}")):
        monkeypatch.setenv(name, value)
    monkeypatch.setenv("COMP_CWORD", str(len(words.split())))
    result = CliRunner().invoke(app, prog_name="stickslip")
    assert result.stdout.split() == [offered]


def test_a_thread_that_is_left_behind_does_not_change_the_end_of_a_command() -> None:
    """As Python dismantles itself, a thread with the lock of stderr blocks it, and one of Arrow that frees bytes aborts it."""
    code = """if True:
        import io, sys, threading
        from cockpit.entry import main

        class Stuck(io.RawIOBase):
            def writable(self):
                return True

            def write(self, _text):
                held.set()
                threading.Event().wait()

        held = threading.Event()
        sys.stderr = io.TextIOWrapper(io.BufferedWriter(Stuck()), write_through=True)
        threading.Thread(target=print, args=("a line",), kwargs={"file": sys.stderr, "flush": True}, daemon=True).start()
        held.wait()
        sys.argv = ["stickslip", "--version"]
        main()
    """
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=PATIENCE_S
    )
    assert (result.returncode, result.stderr) == (0, "")
    assert result.stdout.startswith("stickslip ")


def test_several_logs_have_a_line_each_and_the_worst_exit_status(log: Path) -> None:
    weak = "tests/golden/weak-piezo.mcap"
    result = call("log", "info", weak, str(log))
    first, second = result.stdout.splitlines()
    assert first == f"not ok     {weak}: EXCITER_END"
    assert second.startswith("not judged ")
    assert result.exit_code == 1
    no_log = log.with_name("no.mcap")
    result = call("log", "info", str(log), str(no_log), weak, "--json")
    assert result.exit_code == FAULTS["BAD_LOG"].exit_status
    rows = json.loads(result.stdout)
    assert [row.get("control", row.get("fault")) for row in rows] == ["not judged", "BAD_LOG", "not ok"]
    jsonschema.validate(rows, FORMATS["log-info-result"].schema(), jsonschema.Draft202012Validator)
