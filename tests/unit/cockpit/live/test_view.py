"""The live view: buckets that hold every slip, holes where blocks are lost, and no old value shown as present."""

import json

import numpy as np
import pytest

from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import APPLIED, TRACE, sensor_block
from bridge.wire.topics import SENSORS
from cockpit.figures.signals import PANELS
from cockpit.live.buckets import COLUMNS
from cockpit.live.frame_words import frame_lines
from cockpit.live.server import frame
from cockpit.live.view import View
from tests.unit.cockpit.live.made import BLOCK_NS, GONE, Rig, column, table_of_frame


def test_a_bucket_has_the_smallest_mean_and_largest_sample(rig: Rig, view: View) -> None:
    for number in range(40):
        rig.block(number, 10.0, peak_N=3.0 if number == 12 else None)
        rig.answer(number)
        rig.applied(number, amplitude_m=1e-9 * number)
    buckets = view.step().buckets
    assert buckets is not None
    assert (buckets.first, buckets.end) == (0, 5)  # the last three wait for their commands
    least = column(buckets.values, COLUMNS, "drive_force_N.least")
    assert least[2] == 3.0
    assert least[[0, 1, 3, 4]].tolist() == [10.0] * 4
    assert column(buckets.values, COLUMNS, "drive_force_N.most").tolist() == [10.0] * 5
    assert column(buckets.values, COLUMNS, "drive_force_N.mean")[2] == pytest.approx(10.0 - 7.0 / 100)
    # values that hold from block to block: the last of the bucket
    assert column(buckets.values, COLUMNS, "amplitude_m") == pytest.approx(1e-9 * np.array([4, 9, 14, 19, 24]))
    assert np.isnan(column(buckets.values, COLUMNS, "time_to_slip_s")).all()  # -1: not known


def test_blocks_that_did_not_come_are_a_hole_and_are_counted(rig: Rig, view: View) -> None:
    rig.blocks([*range(20), *range(30, 60)])
    step = view.step()
    assert step.buckets is not None
    force = column(step.buckets.values, COLUMNS, "drive_force_N.mean")
    assert np.isnan(force).tolist() == [False] * 4 + [True] * 2 + [False] * 3
    lost = view.now()["lost"]
    assert (lost["viewer"], lost["controller"], lost["commands"]) == (10, 0, 50)


def test_a_controller_whose_clock_ran_ahead_without_blocks_is_shown_with_its_blocks(rig: Rig, view: View) -> None:
    rig.blocks(range(20))
    for number in range(20, 160):  # stale steps
        rig.answer(19, mode=wire.WATCH, sequence=number, t_ns=(number + 1) * BLOCK_NS)
    for number in range(20, 60):
        rig.block(number)
        rig.answer(number, sequence=number + 140)
    buckets = view.step().buckets
    assert buckets is not None
    assert column(buckets.values, COLUMNS, "mode").tolist() == [wire.EXCITE] * 9


def test_without_a_controller_its_curves_end(rig: Rig, view: View) -> None:
    rig.blocks(range(20))
    for number in range(20, 60):
        rig.block(number)
        rig.applied(number)
    buckets = view.step().buckets
    assert buckets is not None
    assert np.isnan(column(buckets.values, COLUMNS, "mode")).tolist() == [False] * 4 + [True] * 5
    assert not np.isnan(column(buckets.values, COLUMNS, "guard_state")).any()


def test_steps_join_without_a_seam(rig: Rig, view: View) -> None:
    made = []
    for start in range(0, 103, 13):
        rig.blocks(range(start, min(start + 13, 103)))
        buckets = view.step().buckets
        made += [buckets] if buckets is not None else []
    assert [bucket.first for bucket in made[1:]] == [bucket.end for bucket in made[:-1]]
    assert view.run is not None
    kept = view.run.buckets.kept()
    assert kept is not None
    assert (kept.first, kept.end) == (0, 18)
    assert not np.isnan(column(kept.values, COLUMNS, "mode")).any()


def test_old_values_are_not_shown_as_present(rig: Rig, view: View) -> None:
    assert view.now()["answer"]["text"] == "waiting: a rig is connected but has sent no block yet"
    rig.blocks(range(30))
    view.step()
    now = view.now()
    assert (now["phase"], now["mode"], now["velocity_ratio"]) == ("live", "EXCITE", pytest.approx(1.2))
    assert now["answer"]["level"] == "good"
    rig.now_s += 3.0
    view.step()
    now = view.now()
    assert (now["phase"], now["silent_s"]) == ("silent", 3.0)
    assert now["answer"]["text"].startswith("no data for 3 s")
    assert not {"mode", "velocity_ratio", "drive_force_N", "slips", "t_s"} & set(now)
    rig.presence = GONE
    assert view.now()["answer"]["text"].startswith("the rig left 3 s ago")


def test_a_controller_that_is_silent_decides_nothing(rig: Rig, view: View) -> None:
    rig.blocks(range(30))
    view.step()
    rig.now_s += 1.0
    for number in range(30, 60):
        rig.block(number)
        rig.applied(number)
    view.step()
    now = view.now()
    assert now["phase"] == "live"
    assert "mode" not in now
    assert now["slips_of_late"] is None
    assert now["answer"]["text"].startswith("no controller")


def test_an_end_is_shown_and_another_run_restarts_the_view(rig: Rig, view: View) -> None:
    rig.blocks(range(400))
    rig.event("END", "blocks=400")
    assert view.step().new_run
    rig.presence = GONE
    rig.now_s += 2.0
    assert view.now()["phase"] == "ended"
    rig.presence = Rig().presence
    assert view.now()["phase"] == "waiting"
    for number in range(20):  # more than eight in a row, while the old count is silent
        rig.blocks([number])
    step = view.step()
    assert step.new_run
    assert view.now()["phase"] == "live"
    assert view.run is not None
    assert view.run.newest["sensors"] == 19


def test_a_rig_of_other_blocks_is_another_run(rig: Rig, view: View) -> None:
    rig.blocks(range(300))
    view.step()
    for number in range(300, 340):
        record = sensor_block(40).blank()
        record["sequence"], record["t_ns"], record["drive_force_N"] = number, (number + 1) * 1_000_000, 7.0
        rig.say(SENSORS, record.tobytes())
    step = view.step()
    assert step.new_run
    assert step.buckets is not None
    assert set(column(step.buckets.values, COLUMNS, "drive_force_N.mean").tolist()) == {7.0}


def test_a_fault_is_shown_first_with_its_remedy(rig: Rig, view: View) -> None:
    for number in range(20):
        rig.block(number)
        rig.answer(number, mode=wire.WATCH)
        rig.applied(number, guard_state=wire.FAULT, cause=wire.STOP_BY_PERSON)
    view.step()
    answer = view.now()["answer"]
    assert answer["level"] == "bad"
    assert answer["text"].startswith("FAULT: STOP_BY_PERSON: an operator stopped the rig; stickslip reset")


def test_events_cannot_command_a_page_and_pauses_do_not_crowd_them_out(rig: Rig, view: View) -> None:
    rig.event("GUARD", "a\x1b[31m\u202eb" + "x" * 1000)
    rig.event("NEVER_HEARD_OF", "")
    for _ in range(3):
        rig.event("CORE_PAUSE", "core 0 stood still")
    events = view.step().events
    assert events[0].text.startswith("a\\x1b[31m\\u202eb")
    assert len(events[0].text) < 600
    assert (events[0].letter, events[1].help) == ("C", "not known to this version")
    assert (len(events), view.pauses) == (2, 3)


def test_rubbish_is_counted_and_ends_nothing(rig: Rig, view: View) -> None:
    rig.say(SENSORS, b"\xff" * 50)
    rig.say(SENSORS, b"")
    rig.blocks(range(20))
    view.step()
    assert view.now()["phase"] == "live"
    assert view.now()["unreadable"] >= 1


def test_latency_is_counted_in_bars(rig: Rig, view: View) -> None:
    for number in range(100):
        rig.block(number)
        rig.applied(number, round_trip_ns=100_000 if number else 5_000_000, commands_late=0 if number else 1)
    view.step()
    assert view.run is not None
    latency = view.run.tally.latency_us.bars("us")
    assert latency is not None
    assert sum(latency["counts"]) == 100
    assert len(latency["edges_us"]) == len(latency["counts"]) + 1
    assert view.run.tally.latency_us.quantile(0.5) == pytest.approx(100.0, rel=0.005)
    assert view.now()["lost"]["late"] == 1


def test_the_measured_rate_and_the_answer_of_the_exciter_are_shown(rig: Rig, view: View) -> None:
    for number in range(20):
        rig.block(number)
        rig.applied(number, sample_rate_Hz=19_990.1, answer_ns=30_000_000)
    view.step()
    lines = "\n".join(frame_lines(view.now(), []))
    assert "samples  19990.1 a second, measured" in lines
    assert "the exciter answers in 30000 us" in lines


def test_a_frame_is_json_and_columns() -> None:
    columns = np.array([[1.0, np.nan], [3.0, 4.0]], np.float32)
    table, values = table_of_frame(frame("now", {"text": "µ", "none": float("nan")}, columns))
    assert table == {"kind": "now", "text": "µ", "none": None, "rows": 2, "count": 2}
    np.testing.assert_array_equal(values, columns)
    assert json.dumps(table_of_frame(frame("now", {}))[0]["count"]) == "0"


def test_every_curve_of_the_page_is_in_the_buckets_and_on_the_bus() -> None:
    names = {signal.name for panel in PANELS for signal in panel.signals}
    assert names <= {column.removesuffix(".mean") for column in COLUMNS}
    assert {name for name in COLUMNS if "." not in name} <= {*(APPLIED.dtype.names or ()), *(TRACE.dtype.names or ())}
