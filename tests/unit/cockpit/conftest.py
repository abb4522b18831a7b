"""A short log."""

from pathlib import Path

import pytest

from tests.logs import short_log


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "run.mcap"
    path.write_bytes(short_log())
    return path
