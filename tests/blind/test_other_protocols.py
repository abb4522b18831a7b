"""Rigs without a gap under other protocols than the blind check's: facts that a model cannot know must not count as a gap.

The figures of the models that called these rigs a gap are in docs/method/diagnosis.md.
"""

from pathlib import Path

import pytest

from diagnosis.evidence.folder import load_evidence
from diagnosis.fits.baseline import baseline_of
from diagnosis.fits.fit import NOISE
from diagnosis.gap.prepare import prepare
from diagnosis.gap.problem import Problem
from tests.blind.generator import Case, make, runs
from tests.blind.generator.runs import PROTOCOL, Plan

pytestmark = [pytest.mark.slow, pytest.mark.nightly]

HELD_OUT = Plan(drive=((0.0, 0.8e-3),), holdout=True, duration_s=5.0)
PROTOCOLS = {
    # 4.5 periods of 4.5 kHz in a block of 1 ms, with a phase that no log records
    "slips under half a period": (
        Plan(drive=((0.0, 3e-3), (1.7, -3e-3)), duration_s=3.4),
        Plan(drive=((0.0, 0.9e-3),), vibration=((1.0, 3000.0), (1.8, 1200.0), (2.6, 4500.0)), duration_s=3.4),
        HELD_OUT,
    ),
    # a drive that takes 50 ms to reach its speed, and no slip before the vibration
    "a slow climb from rest": (
        Plan(drive=((0.0, 0.8e-3),), duration_s=8.0),
        Plan(drive=((0.0, 0.17e-3),), vibration=((1.6, 802.0), (3.73, 2299.0), (5.87, 4250.0)), duration_s=8.0),
        HELD_OUT,
    ),
    # few blocks without vibration and slips, from which the noise of the accelerometers could be measured
    "shaken nearly throughout": (
        Plan(drive=((0.0, 1.5e-3),), duration_s=8.0),
        Plan(drive=((0.0, 0.5e-3),), duration_s=8.0),
        Plan(drive=((0.0, 2e-3),), vibration=((1.6, 513.0),), duration_s=8.0),
        HELD_OUT,
    ),
}


def assert_no_gap(folder: Path, protocol: tuple[Plan, ...]) -> None:
    make(folder, Case(effects=(), backbone="lugre", tolerances=1.0, leave_out=(), roughness=1.0), 14, protocol)
    evidence = load_evidence(folder)
    fitted = [run for run in prepare(evidence) if not run.holdout]
    fit = baseline_of(Problem(evidence.rig, fitted), lambda *_: None).fit
    assert fit.chi2 < 3.0 * NOISE * len(fit.residual)


@pytest.mark.parametrize("name", PROTOCOLS)
def test_a_rig_inside_its_tolerances_has_no_gap(name: str, tmp_path: Path) -> None:
    assert_no_gap(tmp_path, PROTOCOLS[name])


def test_a_drive_with_ramps_of_speed_has_no_gap(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The drive takes 0.3 s from one speed to the next, where a model with steps of speed would see a gap."""
    monkeypatch.setattr(runs, "DRIVE_RAMP_S", 0.3)
    assert_no_gap(tmp_path, PROTOCOL)
