"""`--json`: one rule for every command about its file and about the output to stdout and stderr."""

import ast
import inspect
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from bridge.faults import FAULTS
from bridge.log import in_charge
from bridge.log.finding import Finding
from bridge.results import strict_json
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.event_codes import EVENTS
from bridge.wire.words import words
from cockpit import judge
from cockpit.cli import app
from cockpit.commands.as_json.option import with_places
from cockpit.judge.finding_codes import FINDINGS
from tests.logs import short_log

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A log `run.mcap` in the working folder."""
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "run.mcap"
    path.write_bytes(short_log())
    return path


def call(*arguments: str):
    return CliRunner().invoke(app, list(arguments))


def leaves(group, path: str = "") -> dict[str, typer.core.TyperCommand]:
    """Every command by its words."""
    places = {}
    for name, command in group.commands.items():
        places |= leaves(command, f"{path}{name} ") if hasattr(command, "commands") else {f"{path}{name}": command}
    return places


COMMANDS = leaves(typer.main.get_command(app))


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_it(command: str) -> None:
    options = [name for parameter in COMMANDS[command].params for name in parameter.opts]
    assert "--json" in options


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_both_words_for_help(command: str) -> None:
    for word in ("-h", "--help"):
        result = call(*command.split(), word)
        assert result.exit_code == 0
        assert "--json" in result.stdout


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("log info a.mcap --json", "log info a.mcap --json=-"),
        ("log info --json a.mcap", "log info --json=- a.mcap"),
        ("log info --json - a.mcap", "log info --json=- a.mcap"),
        ("log info a.mcap --json -", "log info a.mcap --json=-"),
        ("log info --json x.json a.mcap", "log info --json=x.json a.mcap"),
        ("log info a.mcap --json x.json", "log info a.mcap --json=x.json"),
        ("log info a.mcap --json X.JSON", "log info a.mcap --json=X.JSON"),
        ("log info --json=x.json a.mcap", "log info --json=x.json a.mcap"),
        ("diagnose --json folder --jobs 2", "diagnose --json=- folder --jobs 2"),
        ("diagnose folder --json --jobs 2", "diagnose folder --json=- --jobs 2"),
        ("log recover a.mcap --json b.json", "log recover a.mcap --json=b.json"),
        ("log recover --json -- a.json", "log recover --json=- -- a.json"),
        ("plot -- --json", "plot -- --json"),
    ],
)
def test_the_next_word_is_its_file_only_where_it_looks_like_one(words: str, expected: str) -> None:
    assert with_places(words.split()) == expected.split()


@pytest.mark.parametrize(
    "arguments",
    [
        ["log", "check", "run.mcap", "--json"],
        ["log", "check", "--json", "run.mcap"],
        ["log", "check", "--json", "-", "run.mcap"],
        ["log", "check", "run.mcap", "--json=-"],
    ],
)
def test_on_stdout_there_is_nothing_but_json(arguments: list[str], tmp_path: Path) -> None:
    result = call(*arguments)
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["log"] == "run.mcap"
    assert result.stderr == ""
    assert [path.name for path in tmp_path.iterdir()] == ["run.mcap"]


@pytest.mark.parametrize(
    "arguments",
    [
        ["log", "check", "run.mcap", "--json", "new/x.json"],
        ["log", "check", "--json", "new/x.json", "run.mcap"],
        ["log", "check", "--json=new/x.json", "run.mcap"],
    ],
)
def test_with_a_file_the_words_stay_on_stdout(arguments: list[str]) -> None:
    result = call(*arguments)
    assert result.exit_code == 0, result.output
    assert result.stdout == call("log", "check", "run.mcap").stdout
    assert json.loads(Path("new/x.json").read_text()) == json.loads(call("log", "check", "run.mcap", "--json").stdout)


@pytest.mark.parametrize(
    ("place", "code", "why"),
    [
        ("run.mcap/x.json", "LOG_WRITE", "run.mcap/x.json: cannot be written"),
        ("folder.json", "CONFIG", "--json folder.json: must be a file, not a folder"),
        ("run.mcap", "CONFIG", "--json=run.mcap: must be - for stdout or end in .json"),
        ("run.verdict.json", "CONFIG", "--json=run.verdict.json: is named like the verdict of a log"),
        ("", "CONFIG", "--json=.: must be - for stdout or end in .json"),
    ],
)
def test_an_invalid_place_for_the_json_is_refused_before_the_work(place: str, code: str, why: str, log: Path) -> None:
    Path("folder.json").mkdir()
    before = log.read_bytes()
    result = call("plot", "run.mcap", f"--json={place}")
    assert result.exit_code == FAULTS[code].exit_status
    assert result.stdout == ""
    assert result.stderr.startswith(f"stickslip: {code}: ")
    assert why in result.stderr
    assert log.read_bytes() == before
    assert not Path("run.png").exists()


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["plot", "run.mcap", "--nothing", "--json"], "stickslip plot: No such option: --nothing"),
        (["plot", "--json"], "stickslip plot: Missing argument"),
        (["--json", "plot", "run.mcap"], "stickslip: No such option: --json"),
        (["log", "infos", "run.mcap", "--json"], "stickslip log: No such command 'infos'"),
        (["log", "export", "run.mcap", "--json"], "stickslip log export: Missing option '--to'"),
        (["run", "--seed", "soon", "--json"], "stickslip run: Invalid value for '--seed'"),
        (["scenarios", "--json", "folder"], "stickslip scenarios: Got unexpected extra argument"),
    ],
)
def test_a_wrong_command_line_is_json_too(arguments: list[str], line: str) -> None:
    result = CliRunner().invoke(app, arguments, prog_name="stickslip")
    assert result.exit_code == 2
    told = json.loads(result.stdout)
    assert told.keys() == {"fault", "line", "exit_status"}
    assert (told["fault"], told["exit_status"]) == ("CONFIG", 2)
    assert told["line"].startswith(line)
    assert told["line"].endswith("--help")


@pytest.mark.parametrize(
    ("arguments", "fault"),
    [
        (["log", "info", "no.mcap", "--json"], "BAD_LOG"),
        (["diagnose", "nowhere", "--json"], "BAD_EVIDENCE"),
        (["explain", "NO_SUCH_CODE", "--json"], "CONFIG"),
        (["plot", "run.mcap", "--out", "run.mcap/x.png", "--json"], "LOG_WRITE"),
        (["blind", "score", "nowhere", "--json"], "CONFIG"),
    ],
)
def test_a_fault_is_json_where_the_result_would_be(arguments: list[str], fault: str) -> None:
    result = call(*arguments)
    assert json.loads(result.stdout) == {
        "fault": fault,
        "line": json.loads(result.stdout)["line"],
        "exit_status": FAULTS[fault].exit_status,
    }
    assert result.exit_code == FAULTS[fault].exit_status
    assert result.stderr == ""


def test_with_a_file_a_fault_is_a_line_and_no_file() -> None:
    result = call("log", "info", "no.mcap", "--json", "x.json")
    assert result.exit_code == FAULTS["BAD_LOG"].exit_status
    assert result.stdout == ""
    assert result.stderr.startswith("stickslip: BAD_LOG: ")
    assert not Path("x.json").exists()


@pytest.mark.parametrize(
    ("arguments", "keys"),
    [
        (["plot", "run.mcap"], {"picture", "log", "good", "blocks"}),
        (["log", "check", "run.mcap"], {"log", "findings", "messages"}),
        (["log", "recover", "run.mcap"], {"messages", "out", "closed"}),
        (["log", "export", "run.mcap", "--to", "x.csv", "--topic", "trace"], {"files", "rows", "damage"}),
        (["scenarios"], {"scenarios", "rigs"}),
        (["run", "--in-process", "--scenario", "from-the-start", "--set", "duration_s=0.05"], {"log", "good", "rig"}),
        (["replay", "run.mcap", "--closed-loop"], {"was", "now", "log"}),
    ],
)
def test_results_are_objects(arguments: list[str], keys: set[str]) -> None:
    result = call(*arguments, "--json")
    assert keys <= json.loads(result.stdout).keys()


def test_a_replay_of_several_logs_is_a_list_and_words_come_as_they_are_known() -> None:
    Path("again.mcap").write_bytes(Path("run.mcap").read_bytes())
    told = json.loads(call("replay", "run.mcap", "--json", "again.mcap").stdout)
    assert [(entry["log"], entry["identical"]) for entry in told] == [("run.mcap", True), ("again.mcap", True)]
    Path("bad.mcap").write_bytes(b"no log")
    result = call("replay", "run.mcap", "bad.mcap", "--json", "x.json")
    assert result.exit_code == FAULTS["BAD_LOG"].exit_status
    assert result.stdout.startswith("run.mcap: identical, ")


def test_explain_is_a_list() -> None:
    assert json.loads(call("explain", "6", "--json").stdout) == [
        {"exit_status": 6, "fault": "PEER_DIED", "help": FAULTS["PEER_DIED"].help}
    ]
    every = json.loads(call("explain", "--json").stdout)
    assert {entry["fault"] for entry in every if "fault" in entry} == {*FAULTS, None}


def test_explain_knows_every_word_of_a_log() -> None:
    enums = {"mode": wire.Mode, "state": wire.ContactState, "reason": wire.Reason, "limit": wire.Limit}
    for column, enum in enums.items():
        told = json.loads(call("explain", column, "--json").stdout)
        assert {(entry["word"], entry["number"]) for entry in told} == {*enum.items()}
        assert all(entry["help"] and entry["column"] == column for entry in told)
    output = call("explain", "piezo_weak").stdout
    assert output.startswith(
        "reason 10  PIEZO_WEAK      until schema 2: v_a stays below 1.05 v_d with the amplitude at its limit"
    )


def test_explain_knows_every_word_in_capitals_of_a_verdict() -> None:
    texts = [file.read_text() for file in Path(judge.__path__[0]).glob("*.py")]
    for text in [*texts, inspect.getsource(in_charge)]:
        nodes = [*ast.walk(ast.parse(text))]
        documentation = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
        used = {node.value for node in nodes if isinstance(node, ast.Constant) and id(node) not in documentation}
        codes = {code for value in used if isinstance(value, str) for code in re.findall(r"\b[A-Z_]{4,}\b", value)}
        assert codes <= {*FINDINGS, *EVENTS, *FAULTS, *(word.word for word in words())}
    for code in FINDINGS:
        assert f"finding  {code}" in call("explain", code.lower()).stdout


def test_a_named_tuple_becomes_an_object_and_a_not_finite_number_null() -> None:
    value = {"a": [Finding("gap", "x", "y")], "b": (float("nan"), Path("z")), "c": float("-inf")}
    told = {"kind": "gap", "where": "x", "text": "y", "times": 1}
    assert strict_json(value) == {"a": [told], "b": [None, "z"], "c": None}


def test_version_lists_the_installed_versions() -> None:
    command = [sys.executable, "-P", "-m", "cockpit", "--version"]
    output = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert output.startswith("stickslip ")
    assert output.strip().endswith(f"Python {sys.version.split()[0]}")


def test_a_shell_completes_commands_and_options() -> None:
    for typed, expected in (
        ("stickslip d", "diagnose"),
        ("stickslip log e", "export"),
        ("stickslip run --lo", "--lockstep"),
    ):
        environment = {"_STICKSLIP_COMPLETE": "complete_bash", "COMP_WORDS": typed, "COMP_CWORD": str(typed.count(" "))}
        result = CliRunner().invoke(app, [], env=environment, prog_name="stickslip")
        assert expected in result.stdout.split()


def test_an_export_of_nothing_is_reported_and_leaves_an_older_table(tmp_path: Path) -> None:
    table = tmp_path / "run.csv"
    table.write_text("of yesterday\n")
    result = call("log", "export", "run.mcap", "--to", "run.csv", "--topic", "trace", "--from", "90s", "--overwrite")
    assert result.exit_code == 1
    assert "nothing written: no message of these topics in this time; an existing table is unchanged" in result.stdout
    assert table.read_text() == "of yesterday\n"


@pytest.mark.parametrize(
    "words",
    [
        ("log", "check", "run.mcap", "--json", "out.txt"),
        ("log", "info", "--json", "out.txt"),
        ("replay", "run.mcap", "--json", "out.txt"),
        ("diagnose", ".", "--json", "out.txt"),
    ],
)
def test_a_file_of_another_suffix_is_reported_with_its_likely_meaning(words: tuple[str, ...]) -> None:
    result = call(*words)
    assert result.exit_code in {FAULTS["CONFIG"].exit_status, FAULTS["BAD_LOG"].exit_status}
    assert "out.txt" in json.loads(result.stdout)["line"]
    assert "; if it is meant as the file of --json, it must end in .json" in json.loads(result.stdout)["line"]


def test_a_missing_input_is_reported_before_the_others_are_read(log: Path) -> None:
    result = call("replay", str(log), "absent.mcap")
    assert result.exit_code == FAULTS["BAD_LOG"].exit_status
    assert result.stderr == "stickslip: BAD_LOG: absent.mcap: no such file; give the path of a run log, .mcap\n"
    assert result.stdout == ""
