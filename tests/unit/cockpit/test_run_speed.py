"""The expected speed that a run in one process prints."""

from pathlib import Path

import pytest

from cockpit.run.run import run_scenario


def test_a_run_with_faults_in_one_process_prints_its_expected_speed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fault = "fault=[{kind='scaled', target='drive_force_N', value=0.5}]"  # 40 times slower than without
    run_scenario("from-the-start", ["duration_s=0.1", fault], False, True, tmp_path / "run.mcap")
    assert "with faults, message by message: 0.4 s per simulated second" in capsys.readouterr().err
