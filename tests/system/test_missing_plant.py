"""A controller that nobody answers: half a minute of waiting, beside which other tests may run."""

import subprocess
import sys

from bridge.faults import FAULTS
from tests.system.ports import free_endpoint


def test_missing_plant() -> None:
    command = [sys.executable, "-m", "cockpit", "controller", "--endpoint", free_endpoint()]
    result = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert result.returncode == FAULTS["NO_PEER"].exit_status
    assert "no plant answers" in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
