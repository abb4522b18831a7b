"""`look` on records with parts in which the base vibrates."""

from pathlib import Path

import numpy as np
import pytest

from bridge.faults import Fault
from cockpit.look.evidence import write_evidence
from cockpit.look.source import LookOptions, MeasuredRecord, looked_at, read_record
from diagnosis.evidence.folder import load_evidence
from diagnosis.evidence.manifest_keys import VIBRATION
from diagnosis.evidence.run_log import columns_of_log
from diagnosis.look.look import RecordFacts
from tests.unit.cockpit.test_look_command import saw_teeth


def vibrated_at_last() -> MeasuredRecord:
    """Slips of 3 N for 6 s, with a vibration of 20 ms in a stop; then 2 s of vibration with swings of 0.3 N."""
    t_s, force_N, drive_mm = saw_teeth()
    force_N = np.where(t_s < 6.0, force_N, 14.0 + 0.3 * np.abs(2.0 * (5.0 * t_s % 1.0) - 1.0))
    amplitude_m = np.where((t_s < 6.0) & ((t_s < 0.5) | (t_s > 0.52)), 0.0, 1e-8)
    vibration = {"vibration_frequency_Hz": np.full(len(t_s), 200.0), "vibration_amplitude_m": amplitude_m}
    return MeasuredRecord(
        Path("run.mcap"), t_s, force_N, 1e-3 * drive_mm, vibration, RecordFacts(mass_kg=1.5), [], {}, ""
    )


def test_vibrated_parts_and_short_ones_between_them_are_left_out() -> None:
    """On controlled axes they gave slips that were none, and intervals of stiffness and mass without the true value."""
    record = vibrated_at_last()
    seen = looked_at(record)
    assert record.t_s[record.free][[0, -1]] == pytest.approx([0.522, 5.998])
    assert (seen.slips, seen.seconds) == (4, pytest.approx(5.476))
    assert seen.numbers["static_force_N"].value == pytest.approx(16.0, abs=0.1)
    low, high = seen.numbers["stiffness_N_per_m"][1:3]
    assert low <= 3.0 / 1.46 / 5e-4 <= high


def test_the_vibration_of_a_record_stays_in_its_evidence(tmp_path: Path) -> None:
    record = vibrated_at_last()
    write_evidence(record, looked_at(record), tmp_path / "evidence")
    run = load_evidence(tmp_path / "evidence").runs[0]
    assert run.columns["vibration_amplitude_m"].tolist() == record.others["vibration_amplitude_m"].tolist()


def test_a_run_log_is_evidence_with_all_its_channels_and_the_rig_that_it_describes(tmp_path: Path) -> None:
    """Without them a rig with a damped drive, which no slip shows, got an effect although it was ideal."""
    logged = columns_of_log(Path(__file__).parents[2] / "golden" / "slip-then-control.mcap")
    assert logged.rig["drive_stiffness_N_per_m"] == 11700.0
    assert {"mass_accel_mps2", "base_accel_mps2", "mass_position_m", *VIBRATION} <= logged.columns.keys()
    record = vibrated_at_last()
    motion = {name: 1e-4 * np.sin(record.t_s) for name in ("mass_accel_mps2", "base_accel_mps2", "mass_position_m")}
    damped = logged.rig | {"drive_damping_Ns_per_m": 7.0}
    record = record._replace(rig=damped, others=record.others | motion)
    rig, assumed = write_evidence(record, looked_at(record), tmp_path / "evidence")
    assert assumed == []
    assert {name: value for name, value in rig.values().items() if value is not None} == damped | {"mass_kg": 1.5}
    assert rig.tolerance["drive_damping_Ns_per_m"] > 0.0
    evidence = load_evidence(tmp_path / "evidence")
    assert motion.keys() <= evidence.runs[0].columns.keys()


def test_a_run_log_without_a_stretch_free_of_vibration_is_refused() -> None:
    log = Path(__file__).parents[2] / "golden" / "slip-then-control.mcap"
    with pytest.raises(
        Fault, match="vibrates, which hides stick and slip, and has no stretch of 2 s without vibration; record"
    ):
        read_record(log, LookOptions())
