"""`stickslip example`: a first evidence, made whole or not at all."""

import json
import os
import signal
from pathlib import Path

import jsonschema
import pytest
from typer.testing import CliRunner

from cockpit.cli import app
from cockpit.commands.as_json.schemas import FORMATS
from diagnosis.evidence.folder import load_evidence
from diagnosis.synthetic import folder as making
from diagnosis.synthetic.runs import RunPlan
from plant.effects.library import EFFECTS

SHORT = (RunPlan(((0.0, 5e-4),), duration_s=1.0), RunPlan(((0.0, 5e-4),), duration_s=1.0, holdout=True))


@pytest.fixture(autouse=True)
def short(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    """Two runs of a second, made in an empty working folder."""
    monkeypatch.setattr(making, "LADDER", SHORT)
    monkeypatch.chdir(tmp_path)


def example(*arguments: str):
    return CliRunner().invoke(app, ["example", *arguments])


@pytest.mark.slow
def test_an_example_can_be_read_and_does_not_reveal_its_fault() -> None:
    result = example("runs/example")
    assert result.exit_code == 0, result.output
    assert result.stdout.splitlines()[-1] == "next     stickslip diagnose runs/example"
    evidence = load_evidence(Path("runs/example"))
    assert [run.holdout for run in evidence.runs] == [False, True]
    for text in (result.output, Path("runs/example/manifest.toml").read_text()):
        assert not [name for name in EFFECTS if name in text]


def test_the_seed_and_a_chosen_fault_make_another_one() -> None:
    for name, options in {"a": [], "b": [], "c": ["--seed", "2"], "d": ["--effect", "none"]}.items():
        assert example(name, *options).exit_code == 0
    runs = {name: Path(name, "run-01.parquet").read_bytes() for name in "abcd"}
    assert runs["a"] == runs["b"]
    assert len(set(runs.values())) == 3


def test_json_lists_the_runs() -> None:
    table = json.loads(example("made", "--json").stdout)
    jsonschema.validate(table, FORMATS["example-result"].schema())
    assert table == {
        "folder": "made",
        "runs": ["run-01.parquet", "run-02.parquet"],
        "held_out": ["run-02.parquet"],
        "seed": 1,
        "effects": None,
    }


def test_a_chosen_fault_is_stated_with_its_size() -> None:
    result = example("made", "--effect", "drive-backlash")
    assert "2 runs of a rig with drive-backlash, gap_m = 0.0001, 1 of them held out" in result.stdout
    table = json.loads(example("again", "--effect", "drive-backlash", "--json").stdout)
    assert table["effects"] == {"drive-backlash": {"gap_m": 1e-4}}


@pytest.mark.parametrize("existing", ["folder", "file", "link"])
def test_nothing_is_overwritten(existing: str, tmp_path: Path) -> None:
    made = tmp_path / "made"
    {"folder": made.mkdir, "file": made.touch, "link": lambda: made.symlink_to("nowhere")}[existing]()
    result = example("made")
    assert result.exit_code == 2
    assert "made: exists already; nothing was written" in result.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["made"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_ctrl_c_leaves_nothing_behind(number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = RunPlan.columns

    def interrupted(*arguments):
        if list(tmp_path.rglob("run-01.parquet")):
            os.kill(os.getpid(), number)
        return made(*arguments)

    monkeypatch.setattr(RunPlan, "columns", interrupted)
    result = example("new/example")
    assert result.exit_code == 130
    assert "INTERRUPTED" in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_written_is_reported(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    result = example("file/example")
    assert result.exit_code == 5
    assert "LOG_WRITE" in result.stderr
