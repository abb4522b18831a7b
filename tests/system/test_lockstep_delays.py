"""A rig with a delay, a jitter and announcements makes the same tables over the bus as in one process."""

import subprocess
import sys
from pathlib import Path

import pytest

from bridge.log.logfile import STREAMING, read_run
from tests.patience import PATIENCE_S
from tests.system.ports import free_endpoint

SETTINGS = (
    "duration_s=1.2",
    "rig.drive.profile=[[0.0, 0.0], [0.1, 0.002], [0.5, 0.002], [0.7, -0.002], [1.1, -0.002]]",
    "rig.drive.announce_ahead_s=0.05",
    "rig.sensors.force_lowest_N=-50.0",
    "rig.sensors.position_lowest_m=-0.05",
    "rig.loop.delay_s=0.004",
    "rig.loop.jitter_s=0.006",
    "controller.policy.enabled_from_s=0.0",
)


@pytest.mark.slow
@pytest.mark.nightly  # 14 s of CPU; tests/unit/plant/test_loop_delay.py and tests/determinism/test_contract.py have the parts
def test_over_the_bus_as_in_one_process(tmp_path: Path) -> None:
    options = [part for setting in SETTINGS for part in ("--set", setting)]
    for way in (["--lockstep", "--endpoint", free_endpoint()], ["--in-process"]):
        log = tmp_path / f"{way[0].strip('-')}.mcap"
        subprocess.run(
            [sys.executable, "-m", "cockpit", "run", "--scenario", "from-the-start", *options, *way, "--log", str(log)],
            capture_output=True, timeout=PATIENCE_S, check=False,
        )  # fmt: skip
    over_the_bus, at_once = (read_run(tmp_path / f"{name}.mcap") for name in ("lockstep", "in-process"))
    assert len(at_once.sensors) == 1200
    assert len(at_once.announce) >= 300
    for name in STREAMING:
        assert getattr(over_the_bus, name).tobytes() == getattr(at_once, name).tobytes(), name
