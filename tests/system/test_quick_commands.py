"""Interactive commands import only the modules that they need."""

import json
import resource
import subprocess
import sys
from pathlib import Path
from statistics import median

import pytest

from cockpit.run.in_process import run_onboard
from cockpit.run.scenario import load_scenario
from tests.patience import PATIENCE_S
from tests.system.ports import free_endpoint

_HEAVY = {"numba", "scipy", "matplotlib", "pyarrow", "rich", "cockpit.commands.processes"}
_TELL = """
import json, sys
from cockpit.entry import main
sys.argv[0] = "stickslip"
try:
    main()
finally:
    print(json.dumps(list(sys.modules)), file=sys.stderr)
"""
# a command may use as much processor time as so many imports of numpy: log info takes 2.4 of them, the others 2.5
_NUMPIES = 6.0


def _commands(tmp_path: Path) -> dict[str, list[str]]:
    log = tmp_path / "run.mcap"
    run_onboard(load_scenario("paper-c45-c45", ["duration_s=10.0"]), log, {})
    nobody = ["--endpoint", free_endpoint()]
    return {"log info": ["log", "info", str(log)], "stop": ["stop", *nobody], "status": ["status", *nobody]}


@pytest.mark.parametrize(
    ("name", "not_needed"),
    [
        ("log info", _HEAVY | {"zenoh", "pydantic"}),
        ("stop", _HEAVY | {"numpy", "mcap"}),
        ("status", _HEAVY | {"numpy", "mcap"}),
    ],
)
def test_a_quick_command_imports_nothing_heavy(tmp_path: Path, name: str, not_needed: set[str]) -> None:
    command = [sys.executable, "-P", "-c", _TELL, *_commands(tmp_path)[name]]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    assert not not_needed & set(json.loads(done.stderr.splitlines()[-1])), done.stderr


def _cpu_s(command: list[str]) -> float:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, capture_output=True, timeout=PATIENCE_S, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


@pytest.mark.nightly
@pytest.mark.parametrize("name", ["log info", "stop", "status"])
def test_a_quick_command_takes_little_processor_time(tmp_path: Path, name: str) -> None:
    """Each pair one after the other, as the speed of a shared core varies; imports are tested above."""
    numpy = [sys.executable, "-P", "-c", "import numpy"]
    command = [sys.executable, "-P", "-m", "cockpit", *_commands(tmp_path)[name]]
    assert median(_cpu_s(command) / _cpu_s(numpy) for _ in range(3)) < _NUMPIES
