"""Import of two public data sets, stored next to the project and never inside it."""

from pathlib import Path

import numpy as np
import pytest
import scipy.io

from bridge.log.logfile import read_run
from diagnosis.evidence.folder import load_evidence
from diagnosis.evidence.import_table import import_file

DATA = Path(__file__).parents[5] / "shared" / "data"
ENS, EMPS = DATA / "ens_stickslip", DATA / "emps"
WEIGHT_N = 0.0307 * 9.81  # the slider's: its force is given as a share of this

ENS_MAP = """
[channels]
t_s = {{ column = "t" }}
drive_force_N = {{ column = "Fnorm", scale = {weight_N} }}
drive_position_m = {{ column = "t", scale = {speed_mps} }}
[rig]
drive = "spring"
mass_kg = 0.0307
drive_stiffness_N_per_m = {stiffness_N_per_m}
coulomb_force_N = 0.09
static_force_N = 0.12
stribeck_velocity_mps = 0.0005
[run]
drive_velocity_mps = {speed_mps}
"""
EMPS_MAP = """
[channels]
t_s = { column = "t" }
drive_force_N = { column = "vir", scale = 35.15 }
mass_position_m = { column = "qm" }
[rig]
drive = "force"
mass_kg = 95.1
viscous_damping_Ns_per_m = 203.5
coulomb_force_N = 20.4
static_force_N = 22.0
stribeck_velocity_mps = 0.002
"""


@pytest.mark.slow
@pytest.mark.skipif(not ENS.is_dir(), reason=f"needs the ENS Lyon data set in {ENS}")
@pytest.mark.parametrize(
    ("name", "stiffness_N_per_m", "speed_mps", "rows"),
    [
        pytest.param("k168Nm_v42", 168.0, 42e-6, 751_281, marks=pytest.mark.nightly),
        ("k168Nm_v1100", 168.0, 1100e-6, 28_721),
        ("k168Nm_v4300", 168.0, 4300e-6, 7_521),
        ("k1002Nm_v1100", 1002.0, 1100e-6, 28_641),
        pytest.param("k2254Nm_v42", 2254.0, 42e-6, 751_201, marks=pytest.mark.nightly),
    ],
)
def test_a_slider_on_paper(tmp_path: Path, name: str, stiffness_N_per_m: float, speed_mps: float, rows: int) -> None:
    channel_map = tmp_path / "map.toml"
    channel_map.write_text(
        ENS_MAP.format(weight_N=WEIGHT_N, speed_mps=speed_mps, stiffness_N_per_m=stiffness_N_per_m), encoding="utf-8"
    )
    source = ENS / f"{name}.mat"
    import_file(source, channel_map, tmp_path / "evidence")
    evidence = load_evidence(tmp_path / "evidence")
    measured = scipy.io.loadmat(source)
    together = {key: np.concatenate([run.columns[key] for run in evidence.runs]) for key in evidence.runs[0].columns}
    assert len(together["drive_force_N"]) == rows
    assert together["drive_force_N"] == pytest.approx(WEIGHT_N * measured["Fnorm"].ravel())
    assert np.ptp(together["drive_position_m"]) == pytest.approx(speed_mps * np.ptp(measured["t"]))
    held_out = [run for run in evidence.runs if run.holdout]
    assert len(held_out) == (1 if np.ptp(measured["t"]) > 12.0 else 0)  # the last third of a long log
    assert {finding.kind for finding in evidence.findings} - {"holdout"} == {"missing", "tolerance"}
    import_file(source, channel_map, tmp_path / "run.mcap")
    assert len(read_run(tmp_path / "run.mcap").sensors) == rows // 20


@pytest.mark.skipif(not EMPS.is_dir(), reason=f"needs the EMPS data set in {EMPS}")
def test_a_ball_screw_axis(tmp_path: Path) -> None:
    channel_map = tmp_path / "map.toml"
    channel_map.write_text(EMPS_MAP)
    for name in ("DATA_EMPS", "DATA_EMPS_PULSES"):
        import_file(EMPS / f"{name}.mat", channel_map, tmp_path / "evidence")
    evidence = load_evidence(tmp_path / "evidence")
    assert [len(run.t_s) for run in evidence.runs] == [24_841, 24_841]
    measured = scipy.io.loadmat(EMPS / "DATA_EMPS.mat")
    assert evidence.runs[0].columns["drive_force_N"] == pytest.approx(
        float(measured["gtau"].item()) * measured["vir"].ravel(),
        rel=1e-4,  # gtau is 35.1507 in the file, 35.15 in its description
    )
    assert evidence.runs[0].columns["mass_position_m"] == pytest.approx(measured["qm"].ravel())
    assert [run.holdout for run in evidence.runs] == [False, True]
