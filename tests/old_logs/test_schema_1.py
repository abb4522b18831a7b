"""A log of schema 1, made by `stickslip run --in-process` of commit a44e824, is still readable.

It has 1.6 s, two slips, then the controller.
Fields are only appended to a message, so every later version must read the content of this log unchanged.
"""

import hashlib
from pathlib import Path

import pytest

from bridge.log.check.log_check import check_log
from bridge.log.logfile import read_run
from bridge.tables.export import export
from cockpit.judge.judged import judge
from cockpit.run.replay import changes_of
from controller.replay import replay
from diagnosis.evidence.run_log import columns_of_log

LOG = Path(__file__).with_name("schema-1.mcap")
# messages, and SHA-256 over the columns of schema 1 one after the other, as a44e824 reads them
HELD = {
    "sensors": (
        1600,
        "0ecaf01bef83423c",
        "sequence t_ns drive_force_N mass_accel_mps2 base_accel_mps2 mass_position_m drive_position_m",
    ),
    "applied": (
        1600,
        "f2ab803e71bd459f",
        "sequence t_ns frequency_Hz amplitude_m command_block commands fallback round_trip_ns late_ns commands_late",
    ),
    "command": (1600, "8dd73e615a5710cc", "sequence t_ns block frequency_Hz amplitude_m mode limit reason"),
    "trace": (
        1600,
        "582a691fc5f796cd",
        "sequence t_ns block events gap_blocks state mode reason limit slips score force_rate drive_force_N burst_mps2 "
        "drive_velocity_mps vibration_velocity_mps wanted_velocity_mps wanted_amplitude_m wanted_frequency_Hz time_to_slip_s "
        "lateness_ns",
    ),
    "state": (
        160,
        "15570d7f9dbc5aad",
        "sequence t_ns drive_force_N vibration_velocity_mps drive_velocity_mps velocity_ratio force_rate score mode state slips",
    ),
}


@pytest.mark.parametrize("topic", HELD)
def test_every_field_comes_back_unchanged(topic):
    messages, digest, fields = HELD[topic]
    table = getattr(read_run(LOG), topic)
    assert len(table) == messages
    columns = b"".join(table[field].tobytes() for field in fields.split())
    assert hashlib.sha256(columns).hexdigest()[:16] == digest


def test_its_configuration_and_events_come_back():
    run = read_run(LOG)
    assert run.headers["controller"]["schema_version"] == "1"
    assert run.configuration("plant")["rig"]["contact"]["pair"] == "C45-C45 @ 0.063"
    assert [event.code for event in run.events] == ["START", "END", "END"]


def test_it_is_judged_checked_exported_and_evidence(tmp_path):
    verdict = judge(LOG)
    assert (verdict.before.slips, verdict.after) == (2, None)
    assert check_log(LOG).findings == []
    export(LOG, tmp_path / "run.csv", list(HELD))
    assert {path.name for path in tmp_path.iterdir()} == {f"run.{topic}.csv" for topic in HELD}
    columns, findings, _ = columns_of_log(LOG)
    assert findings == []
    assert columns["drive_force_N"].max() == pytest.approx(17.4354553)


def test_replay_goes_through_all_of_it():
    run = read_run(LOG)
    assert replay(run, changes_of(run, [])).compared == 1600
