"""What the README's first screen shows is what a new user gets."""

import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from cockpit.cli import app

NUMBER = re.compile(r"\d+\.\d+")
README = Path(__file__).parents[2] / "README.md"


@pytest.mark.slow
@pytest.mark.nightly
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
    # the last digits are those of a processor: with AVX2 12.2 (11.5 to 12.9), with AVX-512 12.5 (11.9 to 13.2)
    value, low, high = map(float, NUMBER.findall(number))
    (found,) = re.findall(r"candidates drive-damping +98 % +damping ([\d.]+) N s/m", result.output)
    assert low < float(found) < high
    assert low < value < high
