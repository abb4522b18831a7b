"""The command line of the bench keeps the rules of `stickslip`: outputs are checked first, inputs are never replaced."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from bench.app import app
from bridge.faults import FAULTS
from cockpit.cli import app as stickslip


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize(
    "words",
    [
        ["blind", "score", "set", "--key", "key.json", "--report", "r.pdf"],
        ["blind", "pool", "a.json", "--report", "r.pdf"],
        ["control", "--report", "r.pdf"],
    ],
)
def test_a_report_of_another_kind_is_refused_before_the_work(words: list[str], tmp_path: Path) -> None:
    result = CliRunner().invoke(app, words)
    assert result.exit_code == FAULTS["CONFIG"].exit_status
    assert result.stderr.startswith("stickslip: CONFIG: --report r.pdf: must end in .html, .htm; ")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("option", ["--report", "--json"])
@pytest.mark.parametrize("words", [["blind", "score", "set", "--key", "in.json"], ["blind", "pool", "in.json"]])
def test_an_input_is_not_replaced(words: list[str], option: str) -> None:
    name = "link.html" if option == "--report" else "link.json"
    Path("in.json").write_text("{}")
    Path(name).hardlink_to("in.json")
    result = CliRunner().invoke(app, [*words, option, name])
    assert result.exit_code == FAULTS["CONFIG"].exit_status
    assert f"{option} {name}: is " in result.stderr
    assert Path("in.json").read_text() == "{}"


def test_a_fault_is_json_where_the_result_would_be() -> None:
    result = CliRunner().invoke(app, ["blind", "score", "nowhere", "--key", "no.key", "--json"])
    assert json.loads(result.stdout)["fault"] == "BAD_SET"
    assert result.exit_code == FAULTS["BAD_SET"].exit_status


@pytest.mark.parametrize(
    ("words", "new"),
    [
        (["bench", "control", "--small"], "python -m bench control --small"),
        (["blind", "score", "a set", "--key", "k.json"], "python -m bench blind score 'a set' --key k.json"),
        (["blind", "make", "--cases", "3"], "python -m tests.blind make --cases 3"),
        (["bench"], "python -m bench"),
    ],
)
def test_the_commands_before_name_the_new_ones(words: list[str], new: str) -> None:
    result = CliRunner().invoke(stickslip, words)
    assert result.exit_code == FAULTS["CONFIG"].exit_status
    assert f"run `{new}`\n" in result.stderr
