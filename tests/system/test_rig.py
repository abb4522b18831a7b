"""A real rig over the bus: its device is another process, behind the adapter `stream`."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from bridge.log.logfile import read_run
from cockpit.cli import app
from tests.patience import PATIENCE_S
from tests.system.ports import free_endpoint
from tests.unit.bridge.rig.boxes import boxed, table, toml

SEEN = [sys.executable, "-m", "cockpit"]
DEAD_MAN_S, RAMP_S, SLACK_S = 0.1, 0.022, 0.05


def written(folder: Path, port: int, **more: Any) -> Path:
    path = folder / "mine.toml"
    values = table(**({"device": {"address": f"127.0.0.1:{port}", "waits": True}} | more))
    path.write_text(toml(values))
    return path


def test_a_real_rig_runs_in_lockstep_with_the_rig_file_alone(tmp_path: Path) -> None:
    """Its header sets blocks, channels and limits of the controller; without an operator it never vibrates."""
    log = tmp_path / "run.mcap"
    with boxed(tmp_path, settings=["solver.samples_per_block=25"]) as port:
        accelerometer = {"source": 2, "bandwidth_Hz": 8000.0, "highest": 100.0}
        channels = table()["channels"] | {"drive_force_N": {"absent": True}, "base_accel_mps2": accelerometer}
        converter = {"sample_rate_Hz": 25_000.0, "samples_per_block": 25}
        rig = written(tmp_path, port, channels=channels, converter=converter)
        fault = 'fault=[{kind="offset",target="mass_accel_mps2",value=7.0,from_s=0.2}]'
        timed = ["--set", "duration_s=0.4", "--set", fault]
        arguments = ["run", "--rig", str(rig), "--lockstep", *timed, "--log", str(log)]
        result = subprocess.run(
            [*SEEN, *arguments, "--endpoint", free_endpoint(), "--json"],
            timeout=PATIENCE_S,
            capture_output=True,
            text=True,
            check=False,
        )
    assert result.returncode in (0, 1, 14), result.stderr
    run = read_run(log)
    assert len(run.sensors) == len(run.trace) == 400
    assert run.applied["amplitude_m"].max() == 0.0
    assert np.array_equal(run.sensors["drive_force_N"], np.zeros((400, 25), np.float32))
    assert np.isfinite(run.sensors["drive_position_m"]).all()
    shifted = np.median(run.sensors["mass_accel_mps2"][200:]) - np.median(run.sensors["mass_accel_mps2"][:200])
    assert shifted == pytest.approx(7.0, abs=0.1)
    controller = json.loads(run.headers["controller"]["configuration"])
    assert controller["samples_per_block"] == 25
    assert controller["estimator"]["use_force"] is False
    assert controller["amplitude"]["accel_bandwidth_Hz"] == 8000.0
    assert controller["amplitude"]["accel_range_mps2"] == 100.0
    events = {event.code: event.text for event in run.events}
    assert events["INJECTED"].startswith("mass_accel_mps2 offset 7")
    for command in ("replay", "look"):  # the header in the log sets rate and blocks for every reader
        assert CliRunner().invoke(app, [command, str(log)]).exit_code == 0
    assert events["UNPROTECTED"].startswith("no watchdog")


def test_a_rig_that_cannot_be_opened_ends_the_run_with_its_reason(tmp_path: Path) -> None:
    rig = written(tmp_path, 1, device={"address": "127.0.0.1:1"})
    result = CliRunner().invoke(app, ["plant", "--rig", str(rig), "--endpoint", free_endpoint()])
    assert result.exit_code == 15
    assert "NO_DEVICE: box: 127.0.0.1:1: Connection refused" in result.stderr


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["run", "--in-process"], "names a real rig: this command needs a simulated rig"),
        (
            ["plant", "--set", 'fault=[{kind="weak",target="exciter",value=0.5}]'],
            "fault.0.target = exciter: must be a sensor, clock or bus: this rig is real",
        ),
        (
            ["plant", "--set", 'fault=[{kind="late",target="link",value=0.1}]', "--lockstep"],
            "needs a clock, which lockstep lacks",
        ),
        (["plant", "--set", "arm=true"], "arm = true: a real rig is armed by an operator alone"),
        (["controller", "--set", "controller.block_s=0.0005"], "controller.block_s = 0.0005: must equal 0.001"),
        (["rig", "check"], "Connection refused"),
    ],
)
def test_what_a_real_rig_cannot_do_is_one_line(arguments: list[str], line: str, tmp_path: Path) -> None:
    rig = written(tmp_path, 1)
    named = [str(rig)] if arguments[0] == "rig" else ["--rig", str(rig)]
    result = CliRunner().invoke(app, [*arguments, *named])
    assert result.exit_code in (2, 15)
    assert line in result.stderr
    assert "Traceback" not in result.stderr


def rows(record: Path) -> list[list[float]]:
    """Whole rows of a box's record."""
    lines = record.read_text().split("\n")[1:-1]
    return [[float(value) for value in line.split(",")] for line in lines]


def separate(answer_s: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """A box whose exciter has a generator with this answer time, and the rig file's table [exciter] for it."""
    port = int(free_endpoint().rpartition(":")[2])
    device = {"address": f"127.0.0.1:{port}", "dialect": "agilent-33500"}
    box = {"generator": {"port": port, "answer_s": answer_s}}
    return box, {"adapter": "scpi", "stroke_m_per_V": 7.8e-8, "device": device}


@contextmanager
def driven(
    folder: Path, exciter: dict[str, Any] | None = None, **box: Any
) -> Generator[tuple[subprocess.Popen[bytes], Path, str]]:
    """A box, its rig and a controller in real time, once the rig vibrates: the rig's process, the record, the endpoint."""
    record, endpoint = folder / "truth.csv", free_endpoint()
    with boxed(folder, waits=False, record=str(record), dead_man_s=DEAD_MAN_S, **box) as port:
        exciter = exciter or {"enable_line": True}
        rig = written(folder, port, device={"address": f"127.0.0.1:{port}"}, exciter=exciter)
        named = ["--rig", str(rig), "--endpoint", endpoint]
        plant = subprocess.Popen([*SEEN, "plant", *named], stderr=subprocess.DEVNULL)
        controller = subprocess.Popen([*SEEN, "controller", *named], stderr=subprocess.DEVNULL)
        try:
            until_s = time.monotonic() + PATIENCE_S
            arm = [*SEEN, "arm", "--endpoint", endpoint]
            while subprocess.run(arm, capture_output=True, check=False).returncode and time.monotonic() < until_s:
                time.sleep(0.2)
            while rows(record)[-1][5] <= 1e-8 and time.monotonic() < until_s:
                time.sleep(0.1)
            yield plant, record, endpoint
        finally:
            for process in (plant, controller):
                process.send_signal(signal.SIGCONT)
                process.kill()
                process.wait(PATIENCE_S)


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path


@pytest.mark.realtime
@pytest.mark.parametrize("answer_s", [None, 0.03])
@pytest.mark.parametrize("signal_name", ["SIGKILL", "SIGSTOP", "SIGTERM", "SIGINT"])
def test_however_the_rigs_process_ends_the_vibration_ends(signal_name: str, answer_s: float | None, home: Path) -> None:
    """By the device's own record: within its dead man or burst, or as fast as the ramp."""
    box, exciter = ({}, None) if answer_s is None else separate(answer_s)
    with driven(home, exciter, **box) as (plant, record, _):
        os.kill(plant.pid, getattr(signal, signal_name))
        before = record.read_bytes().count(b"\n") - 1
        time.sleep(1.0)
        after = [row[1] for row in rows(record)[before:]]
    assert after[0] > 0.0
    is_killed = signal_name in {"SIGKILL", "SIGSTOP"}
    assert 1e-3 * after.index(0.0) <= SLACK_S + (DEAD_MAN_S if is_killed else RAMP_S + 2.0 * (answer_s or 0.0))
    assert max(after[after.index(0.0) :]) == 0.0


@pytest.mark.realtime
@pytest.mark.parametrize(("clock_ppm", "answer_s"), [(-5000.0, None), (5000.0, 0.03)])
def test_a_converter_with_a_wrong_clock_is_followed(clock_ppm: float, answer_s: float | None, home: Path) -> None:
    """Paced by the computer's clock the loop was 100 ms behind after 20 s, and the accelerometer was accused."""
    box, exciter = ({}, None) if answer_s is None else separate(answer_s)
    with driven(home, exciter, clock_ppm=clock_ppm, **box) as (_, record, endpoint):
        time.sleep(2.0)
        begun = len(rows(record))
        time.sleep(12.0)
        held = np.array(rows(record)[begun:])
        seen = subprocess.run([*SEEN, "status", "--endpoint", endpoint, "--json"], capture_output=True, check=True)
    ratio = held[:, 1] / held[:, 2]
    assert np.abs(held[:, 3]).max() < 0.01  # a slip reaches 0.022 m/s
    assert np.mean((ratio > 1.02) & (ratio < 1.5)) > 0.99
    status = json.loads(seen.stdout)
    assert status["state"] == "ACTIVE"
    assert status["sample_rate_Hz"] == pytest.approx(20_000.0 * (1.0 + 1e-6 * clock_ppm), rel=1e-3)
    assert answer_s is None or 0.9 * answer_s < 1e-9 * status["answer_ns"] < 2.0 * answer_s
