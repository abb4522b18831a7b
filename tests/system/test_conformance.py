"""`stickslip rig conformance` with a device in another process, and with a rig on the bus."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.patience import PATIENCE_S
from tests.system.ports import free_endpoint
from tests.unit.bridge.rig.boxes import boxed, table, toml

STICKSLIP = [sys.executable, "-m", "cockpit"]


def conformance(*arguments: str) -> tuple[int, dict[str, Any]]:
    command = [*STICKSLIP, "rig", "conformance", *arguments, "--json"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    return done.returncode, json.loads(done.stdout)


def failed(result: dict[str, Any]) -> list[str]:
    return [row["name"] for row in result["checks"] if row["status"] == "FAILED"]


def test_a_box_with_the_rig_file_of_the_guide_passes_every_check_that_needs_no_clock(tmp_path: Path) -> None:
    rig, junit = tmp_path / "mine.toml", tmp_path / "report.xml"
    guide = (Path(__file__).parents[2] / "docs/guides/connect-a-rig.md").read_text(encoding="utf-8")
    text = guide.partition("```toml\n")[2].partition("```")[0]
    with boxed(tmp_path) as port:
        rig.write_text(text.replace('127.0.0.1:9000"', f'127.0.0.1:{port}"\nwaits = true'))
        status, result = conformance(str(rig), "--junit", str(junit))
    assert (status, failed(result), len(result["checks"])) == (0, [], 25)
    assert {row["name"] for row in result["checks"] if row["status"] == "skipped"} == {"rate", "watchdog", "close"}
    assert junit.read_text().startswith("<?xml")


@pytest.mark.nightly
def test_a_stiff_axis_whose_acceleration_repeats_samples_passes(tmp_path: Path) -> None:
    rig = tmp_path / "mine.toml"
    exciter = {"enable_line": True, "amplitude_max_m": 1e-6, "amplitude_slew_m_per_s": 1e-5}
    with boxed(tmp_path, rig="ball-screw-axis") as port:
        rig.write_text(toml(table(device={"address": f"127.0.0.1:{port}", "waits": True}, exciter=exciter)))
        status, result = conformance(str(rig))
    assert (status, failed(result)) == (0, [])


@pytest.mark.parametrize(
    ("fault", "expected"),
    [
        ("", []),
        pytest.param('fault=[{kind="scaled",target="drive_force_N",value=-1.0}]', ["force"], marks=pytest.mark.nightly),
    ],
)
def test_a_rig_on_the_bus_is_tried_as_by_its_controller(fault: str, expected: list[str]) -> None:
    endpoint = free_endpoint()
    settings = ["--set", "arm=true"] + (["--set", fault] if fault else [])
    scenario = ["--scenario", "from-the-start", "--set", "duration_s=60.0", "--lockstep", *settings]
    plant = subprocess.Popen([*STICKSLIP, "plant", *scenario, "--endpoint", endpoint], stderr=subprocess.DEVNULL)
    try:
        status, result = conformance("--endpoint", endpoint, "--lockstep")
    finally:
        plant.terminate()
        plant.wait(PATIENCE_S)
    assert (failed(result), len(result["checks"])) == (expected, 25)
    assert status == bool(expected)


@pytest.mark.parametrize("arguments", [[], ["mine.toml", "--endpoint", "tcp/127.0.0.1:1"]])
def test_a_rig_file_or_an_address_is_needed(arguments: list[str]) -> None:
    status, result = conformance(*arguments)
    assert status == 2
    assert result["line"].startswith("RIG, --endpoint: ")
