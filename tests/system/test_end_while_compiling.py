"""A first start compiles for half a minute, and a signal ends it at once: in one process, and in the children of a run."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from bridge.compiling import PROGRESS
from bridge.faults import FAULTS
from tests.patience import PATIENCE_S
from tests.system.ports import free_endpoint

# half a minute of compiling on a busy computer; `make test` has tests/unit/bridge/test_compiling.py
pytestmark = pytest.mark.nightly

STICKSLIP = Path(sys.executable).with_name("stickslip")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("processes", [False, True])
def test_a_signal_ends_a_first_start(tmp_path: Path, number: signal.Signals, processes: bool) -> None:
    kernels, log = tmp_path / "kernels", tmp_path / "run.mcap"
    where = ["--endpoint", free_endpoint()] if processes else ["--in-process"]
    with subprocess.Popen(
        [STICKSLIP, "run", *where, "--log", log],
        env=os.environ | {"NUMBA_CACHE_DIR": str(kernels)},
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
    ) as started:
        assert started.stderr is not None
        before = ""
        while PROGRESS not in before:
            before = started.stderr.readline()
            assert before
        started.send_signal(number)
        after = started.stderr.read()
        assert started.wait(PATIENCE_S) == FAULTS["INTERRUPTED"].exit_status
    name = "Ctrl-C" if number == signal.SIGINT else number.name
    assert f"INTERRUPTED: stopped by {name}" in after
    assert not log.exists()
    # the controller's step is the kernel that takes the longest: it was not waited for
    assert not list(kernels.rglob("core.step-*.nbc"))
