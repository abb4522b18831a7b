"""The same tests on a device: a box that waits for its commands, in simulated time, and one with a clock, in real time."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from cockpit.cli import app
from cockpit.run.scenario_file import deploy_folder
from tests.system.test_rig import written
from tests.unit.bridge.rig.boxes import boxed

TESTS = deploy_folder() / "tests"


def call(*words: object) -> tuple[int, str]:
    result = CliRunner().invoke(app, ["test", *map(str, words), "--jobs", "1"])
    return result.exit_code, result.stdout


@pytest.mark.slow
def test_the_same_tests_run_on_a_device(tmp_path: Path) -> None:
    """Two of them; `make nightly` has all. A test for simulated rigs alone is UNTESTED."""
    with boxed(tmp_path) as port:
        rig = written(tmp_path, port)
        status, text = call(TESTS / "stop.toml", TESTS / "kill.toml", "--rig", rig, "--arm")
        assert (status, text.count("PASSED   ")) == (0, 2), text
        status, text = call(TESTS / "limits.toml", "--rig", rig, "--logs", tmp_path, "--set", "duration_s=1.1")
        assert "FAILED" in text  # without --arm it never vibrates
        status, text = call(TESTS / "load-step.toml", "--set", "rig.drive.damping_Ns_per_m=1.0", "--rig", rig)
        assert status == 14
        assert "UNTESTED load-step: NOT_JUDGED" in text
        assert "rig.drive.damping_Ns_per_m: changes the simulated rig" in text
        assert "speed and load of a real rig are set by its machine" in call(TESTS / "load-step.toml", "--rig", rig)[1]
    rig = written(tmp_path, port, device={"address": f"127.0.0.1:{port}"})
    status, text = call(TESTS / "clip.toml", TESTS / "reverse.toml", "--rig", rig)
    assert status == 14
    assert "must be a sensor, clock or bus: this rig is real" in text
    assert "rig.sensors: changes the simulated rig" in text


@pytest.mark.nightly
def test_all_tests_run_on_a_device(tmp_path: Path) -> None:
    """Covered by the two above. The drive of a box goes on from test to test, 50 mm in all."""
    with boxed(tmp_path, settings=["sensors.position_range_m=1.0"]) as port:
        text = call(TESTS, "--rig", written(tmp_path, port), "--arm", "--logs", tmp_path)[1]
    assert "FAILED" not in text
    assert "ERROR" not in text
    assert text.count("PASSED   ") >= 16


@pytest.mark.realtime
def test_a_test_in_real_time_counts_from_the_moment_of_arming(tmp_path: Path) -> None:
    with boxed(tmp_path, waits=False, settings=["sensors.position_range_m=1.0"]) as port:
        rig = written(tmp_path, port, device={"address": f"127.0.0.1:{port}"})
        status, text = call(TESTS / "stop.toml", TESTS / "kill.toml", "--rig", rig, "--arm", "--logs", tmp_path)
    assert status == 0, text
