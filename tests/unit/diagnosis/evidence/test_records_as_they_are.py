"""Records in unusual forms: parts of a file, a tare, a motor current, velocities, unknown numbers, one long log."""

from pathlib import Path

import numpy as np
import pytest

from bridge.faults import Fault
from diagnosis.evidence.assumed import with_assumed
from diagnosis.evidence.folder import load_evidence
from diagnosis.features.segments import never_constant
from tests.evidence_folder import MANIFEST, Columns, columns, folder

AXIS = """format = "evidence/1"
[rig]
drive = "force"
mass_kg = 20.0
coulomb_force_N = 20.0
static_force_N = 22.0
stribeck_velocity_mps = 0.003
force_per_current_N_per_A = 40.0
[[run]]
file = "run-01.parquet"
"""


def long_log(seconds: float = 20.0) -> Columns:
    """A slow stick-slip under an even drive."""
    t_s = np.arange(round(1000 * seconds)) / 1000
    force_N = 15.0 + 2.0 * (2.0 * t_s % 1.0) + np.random.default_rng(1).normal(0.0, 0.02, t_s.size)
    return {"t_s": t_s, "drive_force_N": force_N}


def axis() -> Columns:
    """To and fro with friction, a current in place of a force and a velocity in place of a place."""
    t_s = np.arange(8000) / 1000
    velocity, accel = 0.1 * np.sin(3.0 * t_s), 0.3 * np.cos(3.0 * t_s)
    current_A = (25.0 * accel + 20.0 * np.tanh(velocity / 1e-3)) / 40.0
    return {"t_s": t_s, "motor_current_A": current_A, "mass_velocity_mps": velocity}


def test_two_stretches_of_a_file_are_two_runs(tmp_path: Path) -> None:
    stretches = (
        'until_s = 12.0\n[[run]]\nfile = "run-01.parquet"\ndrive_velocity_mps = 0.0005\nfrom_s = 12.0\nholdout = true\n'
    )
    evidence = load_evidence(folder(tmp_path, long_log(), MANIFEST + stretches))
    first, second = evidence.runs
    assert [first.file, second.file] == ["run-01-0-to-12s.parquet", "run-01-12-to-end.parquet"]
    assert first.t_s[-1] < 12.0 <= second.t_s[0]
    assert len(first.t_s) + len(second.t_s) == 20000
    assert [first.holdout, second.holdout] == [False, True]


@pytest.mark.parametrize(
    ("added", "expected"),
    [
        ("from_s = 3.0\nuntil_s = 2.0\n", "until_s = 2: must be above from_s = 3"),
        ("from_s = 30.0\n", "from_s = 30: must be before its end at 19.999 s"),
        (
            'until_s = 12.0\n[[run]]\nfile = "run-01.parquet"\ndrive_velocity_mps = 0.0005\nfrom_s = 11.0\n',
            "run.from_s = 11 of 'run-01.parquet': another run has this stretch as well",
        ),
    ],
)
def test_a_wrong_stretch_is_one_clear_line(tmp_path: Path, added: str, expected: str) -> None:
    with pytest.raises(Fault) as caught:
        load_evidence(folder(tmp_path, long_log(), MANIFEST + added))
    assert expected in caught.value.line


def test_a_third_of_one_long_log_is_held_out_and_named(tmp_path: Path) -> None:
    evidence = load_evidence(folder(tmp_path, long_log(), MANIFEST))
    assert [run.holdout for run in evidence.runs] == [False, True]
    assert evidence.runs[1].t_s[0] == pytest.approx(13.33, abs=0.01)
    (reported,) = [finding for finding in evidence.findings if finding.kind == "holdout"]
    assert "13.3 to 20 s are held out" in reported.text


def test_the_held_out_part_has_only_speeds_of_the_other_parts(tmp_path: Path) -> None:
    data = long_log(30.0)
    speed = np.where(data["t_s"] < 20.0, 5e-4, 4e-3)  # the last third alone is fast
    speed = np.where(data["t_s"] < 10.0, -5e-4, speed)  # and the first alone goes back
    speed[12000:13000] = -5e-4
    data["drive_position_m"] = np.cumsum(speed) / 1000
    manifest = MANIFEST.replace("drive_velocity_mps = 0.0005\n", "")
    evidence = load_evidence(folder(tmp_path, data, manifest))
    held_out = [run for run in evidence.runs if run.holdout]
    assert [run.file for run in held_out] == ["run-01-10-to-20s.parquet"]
    assert len(evidence.runs) == 3


def test_a_tare_is_taken_off_and_a_load_is_known(tmp_path: Path) -> None:
    data = columns()
    bare = load_evidence(folder(tmp_path, data)).runs[0].columns["drive_force_N"]
    run = load_evidence(folder(tmp_path, data, MANIFEST + "tare_N = 1.5\nnormal_load_N = 40.0\n")).runs[0]
    assert run.columns["drive_force_N"] == pytest.approx(bare - 1.5)
    assert set(run.columns["normal_load_N"]) == {40.0}


def test_a_motor_current_is_a_force_and_a_velocity_a_place(tmp_path: Path) -> None:
    data = axis()
    (run,) = load_evidence(folder(tmp_path, data, AXIS)).runs
    assert run.columns["drive_force_N"] == pytest.approx(40.0 * data["motor_current_A"])
    assert np.ptp(run.columns["mass_position_m"]) == pytest.approx(2.0 * 0.1 / 3.0, rel=1e-3)
    with pytest.raises(Fault) as caught:
        load_evidence(folder(tmp_path, data, AXIS.replace("force_per_current_N_per_A = 40.0\n", "")))
    assert "rig.force_per_current_N_per_A: missing" in caught.value.line


def test_another_force_on_an_axis_is_added(tmp_path: Path) -> None:
    data = axis() | {"other_force_N": np.full(8000, -5.0)}
    (run,) = load_evidence(folder(tmp_path, data, AXIS)).runs
    assert run.columns["drive_force_N"] == pytest.approx(40.0 * data["motor_current_A"] - 5.0)


def test_unknown_numbers_get_a_wide_tolerance_and_are_reported(tmp_path: Path) -> None:
    manifest = AXIS.replace("mass_kg = 20.0\n", "").replace("stribeck_velocity_mps = 0.003\n", "")
    evidence = load_evidence(folder(tmp_path, axis(), manifest))
    assert evidence.rig.mass_kg == pytest.approx(25.0, rel=0.05)  # estimated from force and acceleration
    assert evidence.rig.tolerance["mass_kg"] == evidence.rig.tolerance["stribeck_velocity_mps"] == 1.0
    assert {"mass_kg", "stribeck_velocity_mps"} <= set(evidence.assumed)
    reported = {finding.where: finding.text for finding in evidence.findings if finding.kind == "assumed"}
    assert "as the runs show it" in reported["manifest.toml: rig.mass_kg"]
    assert "decides nothing" in reported["manifest.toml: rig.stribeck_velocity_mps"]


def test_unknown_numbers_of_a_rotary_rig_are_in_proportion_to_its_spring() -> None:
    """The paper's rig at a radius of 1 m and of 10 mm; one radius was assumed for both, and its contact was refused."""
    known = {
        "drive": "torsion",
        "mass_kg": 1.5,
        "drive_stiffness_N_per_m": 11700.0,
        "static_force_N": 17.38,
        "coulomb_force_N": 14.49,
    }
    powers = {"mass_kg": 2, "drive_stiffness_N_per_m": 2, "static_force_N": 1, "coulomb_force_N": 1}
    small = {name: value * 0.01 ** powers[name] if name in powers else value for name, value in known.items()}
    for table, radius_m in ((known, 1.0), (small, 0.01)):
        filled, _ = with_assumed(table)
        with_radius, _ = with_assumed(table | {"radius_m": radius_m})
        for name in ("contact_stiffness_N_per_m", "stribeck_velocity_mps"):
            assert filled[name] == pytest.approx(with_radius[name], rel=0.02)


@pytest.mark.parametrize(("way", "expected"), [("sine", True), ("even", False), ("speeds", False)])
def test_a_drive_that_is_never_constant_is_known(way: str, expected: bool) -> None:
    from diagnosis.features.segments import _pieces

    t_s = np.arange(20000) / 1000
    speed = {
        "sine": 4e-3 * np.sin(0.6 * t_s),
        "even": np.full(20000, 1e-3),
        "speeds": np.where(t_s < 8.0, 1e-3, np.where(t_s < 14.0, -3e-3, 2e-4)),
    }[way]
    position_m = np.cumsum(speed) / 1000 + np.random.default_rng(1).normal(0.0, 3e-7, 20000)
    assert never_constant(position_m, _pieces(position_m)) is expected
