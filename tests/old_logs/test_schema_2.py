"""A log of schema 2, made by `stickslip run --in-process --scenario from-the-start` of 5fe93e7, is still readable.

Its blocks end with the checksum: the vibration in force is not known, and a reader of the bus still verifies them.
"""

from pathlib import Path

from bridge.log.check.log_check import check_log
from bridge.log.logfile import read_run
from bridge.wire.messages import is_whole, sensor_block
from cockpit.judge.judged import judge
from cockpit.run.replay import changes_of
from controller.replay import replay

LOG = Path(__file__).with_name("schema-2.mcap")


def test_its_fields_come_back_and_the_vibration_in_force_is_not_known() -> None:
    run = read_run(LOG)
    assert (len(run.sensors), run.sensors["sequence"][-1], run.trace["velocity_ratio"].max()) == (500, 499, 1.2)
    assert not any(
        run.sensors[name].any() for name in ("applied_Hz", "applied_m", "applied_block", "fallback", "guard_limit")
    )
    assert replay(run, changes_of(run, [])).compared == 500


def test_it_is_judged_and_checked() -> None:
    assert judge(LOG).after.slips == 0
    assert check_log(LOG).findings == []


def test_its_blocks_keep_their_checksum() -> None:
    sensors = read_run(LOG).sensors
    block = sensors[100:101].tobytes()
    assert sensor_block(20).is_canonical(block)
    assert is_whole(block)
    for at in (40, -1):  # a sample, and the last byte of the vibration in force
        changed = bytearray(block)
        changed[at] ^= 1
        assert not is_whole(bytes(changed))
