"""What the README's first screen shows is what a new user gets."""

import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from cockpit.cli import app

README = Path(__file__).parents[2] / "README.md"


@pytest.mark.slow
def test_the_example_is_diagnosed_as_the_readme_shows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = README.read_text(encoding="utf-8")
    commands = re.search(r"^ +(stickslip example .*?)(?: +#.*)?$", text, re.MULTILINE)
    shown = re.search(r"^ +(effect: .*?)(?: +# true: .*)?$", text, re.MULTILINE)
    assert commands
    assert shown
    monkeypatch.chdir(tmp_path)
    for command in commands[1].split(" && "):
        result = CliRunner().invoke(app, shlex.split(command)[1:])
        assert result.exit_code == 0, result.output
    # the README has the headline and the number of the first candidate in one line
    headline, number = shown[1].split("; ")
    assert headline in result.output.splitlines()
    assert number in result.output
