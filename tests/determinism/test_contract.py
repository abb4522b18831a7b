"""The determinism contract: the same inputs give the same bytes, however the run is made."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from typer.testing import CliRunner

from bridge.log.logfile import RunData, read_run
from cockpit.cli import app
from cockpit.run.in_process import run_onboard
from cockpit.run.scenario import load_scenario
from tests.patience import PATIENCE_S
from tests.system.ports import free_endpoint

TABLES = ("sensors", "applied", "command", "trace", "state")


def same(first: RunData, second: RunData) -> None:
    for name in TABLES:
        assert getattr(first, name).tobytes() == getattr(second, name).tobytes(), name
    assert [s.SerializeToString() for s in first.snapshots] == [s.SerializeToString() for s in second.snapshots]
    assert first.headers == second.headers


def onboard(path: Path, *settings: str) -> RunData:
    scenario = load_scenario("paper-c45-c45", list(settings))
    run_onboard(scenario, path, {"scenario": scenario.name})
    return read_run(path)


@pytest.mark.slow
def test_record_equals_record(tmp_path: Path) -> None:
    settings = ("duration_s=10.0",)
    first = onboard(tmp_path / "a.mcap", *settings)
    assert len(first.trace) == 10_000
    same(first, onboard(tmp_path / "b.mcap", *settings))


def test_another_seed_gives_another_run(tmp_path: Path) -> None:
    first = onboard(tmp_path / "a.mcap", "duration_s=0.5")
    other = onboard(tmp_path / "b.mcap", "duration_s=0.5", "seed=2")
    assert first.sensors.tobytes() != other.sensors.tobytes()


def topics(path: Path) -> dict[str, list[tuple[int, int, int, bytes]]]:
    """Every message of a log by topic, times and sequence included, as the mcap library reads it."""
    messages: dict[str, list[tuple[int, int, int, bytes]]] = {}
    with path.open("rb") as file:
        for _, channel, message in make_reader(file).iter_messages(log_time_order=False):
            row = (message.log_time, message.publish_time, message.sequence, message.data)
            messages.setdefault(channel.topic, []).append(row)
    return messages


@pytest.mark.slow
def test_twice_over_the_bus_and_in_one_process_are_the_same_bytes(tmp_path: Path) -> None:
    logs = [tmp_path / f"{name}.mcap" for name in ("first", "second", "alone")]
    for log, more in zip(
        logs, (["--endpoint", free_endpoint()], ["--endpoint", free_endpoint()], ["--in-process"]), strict=True
    ):
        # both phases and six snapshots in fewer blocks
        shorter = ["--set", "duration_s=6.0", "--set", "controller.policy.enabled_from_s=2.0"]
        arguments = ["--lockstep", "--scenario", "paper-c45-c45", "--seed", "1", *shorter, *more, "--log", str(log)]
        if more == ["--in-process"]:  # a separate process imports for 2 s of CPU
            assert CliRunner().invoke(app, ["run", *arguments]).exit_code == 0
            continue
        subprocess.run(
            [sys.executable, "-m", "cockpit", "run", *arguments], check=True, timeout=PATIENCE_S, capture_output=True
        )
    first, second, alone = (topics(log) for log in logs)
    assert set(first) == {
        *("/sensors", "/applied", "/command", "/trace", "/state", "/snapshot", "/event/plant", "/event/controller"),
        *("/scope", "/log"),
    }
    assert len(first["/trace"]) == 6_000
    for topic in first:
        assert first[topic] == second[topic] == alone[topic], topic


@pytest.mark.slow
@pytest.mark.parametrize(
    "settings", [("duration_s=0.35", "controller.policy.enabled_from_s=0.0", "rig.drive.stiffness_N_per_m=3e5")]
)
def test_compiled_equals_interpreted(tmp_path: Path, settings: tuple[str, ...]) -> None:
    compiled = onboard(tmp_path / "compiled.mcap", *settings)
    log = tmp_path / "interpreted.mcap"
    changes = [part for setting in settings for part in ("--set", setting)]
    subprocess.run(
        [sys.executable, "-m", "cockpit", "run", "--in-process", *changes, "--log", str(log)],
        check=True,
        timeout=PATIENCE_S,
        capture_output=True,
        env=os.environ | {"NUMBA_DISABLE_JIT": "1"},
    )
    interpreted = read_run(log)
    for name in TABLES:
        assert getattr(compiled, name).tobytes() == getattr(interpreted, name).tobytes(), name
    assert np.any(compiled.command["amplitude_m"] > 0)  # the vibration's code ran as well
