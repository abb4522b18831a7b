"""In lockstep nothing is late: stalls that would end a run in real time cost nothing."""

import os
import signal
import time
from pathlib import Path

import pytest

from bridge.log.logfile import read_run
from tests.patience import PATIENCE_S
from tests.system.run_under_way import Run

pytestmark = pytest.mark.realtime  # it is frozen between its first chunk and its end, which a busy computer may miss


@pytest.mark.parametrize("victim", ["plant", "controller", pytest.param("recorder", marks=pytest.mark.nightly)])
def test_in_lockstep_a_pause_costs_nothing(tmp_path: Path, runs: list[Run], victim: str) -> None:
    """A busy computer pauses processes for longer than the lease of real time, which would break the link and lose messages."""
    # in charge from the start: a run of which nothing was tested has another status
    run = Run(tmp_path / "run.mcap", "--lockstep", "--set", "controller.policy.enabled_from_s=0.0", seconds=5.0)
    runs.append(run)
    run.wait_until_recording()
    os.kill(run.children[victim], signal.SIGSTOP)
    time.sleep(0.5)
    os.kill(run.children[victim], signal.SIGCONT)
    status, _, err = run.end(PATIENCE_S)
    assert (status, err) == (0, "")
    data = read_run(run.log)
    assert len(data.sensors) == len(data.command) == 5_000
    assert not [event.text for event in data.events if event.code == "GAP"]
