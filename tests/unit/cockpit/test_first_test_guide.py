"""The examples of docs/guides/your-first-test.md run, and print its outputs."""

import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from cockpit.cli import app
from cockpit.run.scenario import load_scenario
from cockpit.testing.suite import cases_of, mutants_of

GUIDE = (Path(__file__).parents[3] / "docs/guides/your-first-test.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(\w*)\n(.*?)```", GUIDE, re.DOTALL)
FIRST, STEPS, SWEEPS, MUTANT = (text for kind, text in BLOCKS if kind == "toml")
PASSES, FAILS = (text for kind, text in BLOCKS if not kind)


def without_digits(text: str) -> str:
    return re.sub(r"\d+\.\d+", "#", text)


@pytest.fixture
def first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "first.toml").write_text(FIRST)
    return Path("first.toml")


@pytest.mark.slow
def test_the_first_example_passes_and_fails_as_printed(first: Path) -> None:
    for end, printed in (("from_s = 5.3", PASSES), ("from_s = 5.01", FAILS)):
        first.write_text(FIRST.replace("from_s = 5.3", end))
        output = CliRunner().invoke(app, ["test", str(first), "--jobs", "1"]).stdout
        assert without_digits(output) == without_digits(printed)


def test_steps_sweeps_and_defects_fit_the_first_example(first: Path) -> None:
    first.write_text(f"{FIRST}{STEPS}{SWEEPS}{MUTANT}")
    cases, _ = cases_of([first], [])
    assert [case.name for case in cases] == [
        *(f"first-v_ratio={value}" for value in (1.1, 1.2, 1.3)),
        "first-slow",
        "first-weak",
    ]
    assert len(mutants_of(cases)[0]) == len(cases)
    assert [step.at_s for step in load_scenario("first.toml:v_ratio=1.2", []).step] == [1.0, 2.0, 2.5, 2.8]


@pytest.mark.slow
def test_the_example_in_python_passes(first: Path) -> None:
    (text,) = (text for kind, text in BLOCKS if kind == "python")
    first.with_name("test_guide.py").write_text(text)
    assert pytest.main(["-q", "-p", "no:cacheprovider", "--rootdir", ".", "-c", "/dev/null", "test_guide.py"]) == 0
