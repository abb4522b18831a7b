"""Fixtures of this folder."""

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.system.run_under_way import Run, children_of


@pytest.fixture
def runs(tmp_path: Path) -> Iterator[list[Run]]:
    made: list[Run] = []
    yield made
    for run in made:
        pids = [*children_of(run.process.pid), run.process.pid]
        if run.process.poll() is None:
            for pid in pids:
                os.kill(pid, signal.SIGKILL)
            run.process.wait()
