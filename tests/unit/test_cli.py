"""Commands that read a log or draw: what comes of logs and options that are not as usual."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from cockpit.cli import app
from tests.logs import empty_log, short_log

PNG = b"\x89PNG"


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "run.mcap"
    path.write_bytes(short_log())
    return path


def call(*arguments: str):
    return CliRunner().invoke(app, list(arguments))


def test_a_log_without_a_block_is_drawn(tmp_path: Path) -> None:
    out = tmp_path / "run.png"
    result = call("plot", str(empty_log(tmp_path)), "--out", str(out))
    assert result.exit_code == 0, result.output
    assert out.read_bytes().startswith(PNG)
