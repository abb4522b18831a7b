"""Sensor faults in real logs: each fault has the effect of its name, and every case can be read as evidence."""

from pathlib import Path

import numpy as np
import pytest

from diagnosis.evidence.folder import load_evidence
from tests.blind.real_logs import RIGS, bias, dead_time, drift, gain, lag, real_cases
from tests.real.evidences import AXIS, MISSING, SLIDER

pytestmark = pytest.mark.slow

T_S = np.arange(2000) / 1000.0
RAMP_N = 3.0 + 2.0 * T_S


def test_each_faulty_sensor_distorts_a_ramp_as_expected() -> None:
    late = slice(500, None)
    assert gain(0.1)(T_S, RAMP_N) == pytest.approx(1.1 * RAMP_N)
    assert bias(-0.2)(T_S, RAMP_N) == pytest.approx(RAMP_N - 0.2)
    assert drift(0.5, -1.0)(T_S, RAMP_N) == pytest.approx(RAMP_N + 0.5 * (T_S + 1.0))
    assert dead_time(0.02)(T_S, RAMP_N)[late] == pytest.approx((RAMP_N - 0.04)[late])
    # a discrete pole comes half a sample earlier than the continuous one
    assert lag(0.02)(T_S, RAMP_N)[late] == pytest.approx((RAMP_N - 0.04)[late], abs=0.0025)
    assert lag(0.02)(T_S, RAMP_N)[0] == pytest.approx(3.0)


@pytest.mark.skipif(not (SLIDER.is_dir() and AXIS.is_dir()), reason=MISSING)
def test_every_case_is_evidence(tmp_path: Path) -> None:
    cases = list(real_cases(np.random.default_rng(1)))
    assert [case.effects for case in cases] == [(fault,) for rig in RIGS.values() for fault in rig.faults]
    for number, case in enumerate(cases):
        case.write(tmp_path / str(number))
        evidence = load_evidence(tmp_path / str(number))
        assert [run.holdout for run in evidence.runs] == [False, True]
        assert {finding.kind for finding in evidence.findings} <= {"missing"}
        assert case.numbers
        assert (tmp_path / str(number) / "manifest.toml").read_text().count("sensor") == 0
    again = list(real_cases(np.random.default_rng(1)))
    assert [case.numbers for case in again] == [case.numbers for case in cases]
