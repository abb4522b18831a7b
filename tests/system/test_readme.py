"""The README's first screen shows the output that a new user gets."""

import re
from pathlib import Path

import pytest

from docs import readme

_NUMBER = re.compile(r"\d+\.\d+")
# the last digits depend on the processor: with AVX2 a damping of 12.2 N s/m (11.5 to 12.9), with AVX-512 12.6 (11.9 to 13.3)
_ALIKE = 0.06


@pytest.mark.slow
@pytest.mark.nightly
def test_the_commands_of_the_readme_print_the_shown_output(tmp_path: Path) -> None:
    """After a change of their output: `make readme`."""
    now = readme.block(readme.kept(readme.README.read_text(encoding="utf-8"), tmp_path / "demo.png"))
    shown = readme.block(readme.KEPT.read_text(encoding="utf-8"))
    assert _NUMBER.sub("N", now) == _NUMBER.sub("N", shown)
    numbers = [float(number) for number in _NUMBER.findall(shown)]
    assert [float(number) for number in _NUMBER.findall(now)] == pytest.approx(numbers, rel=_ALIKE)
