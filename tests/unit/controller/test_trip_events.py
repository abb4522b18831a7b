"""Events of the controller's trips, and detection of late blocks."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from bridge.guard.events import changes
from bridge.log.logfile import read_run
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.event_codes import EVENTS, TRIPS
from bridge.wire.messages import TRACE
from cockpit.run.in_process import run_onboard
from cockpit.run.scenario import load_scenario
from controller.freshness import HOLD_NS, MARGIN_NS, Age
from controller.trips.trip_events import TripEvents
from tests.closed_loop.sensor_faults import suffer

MS_NS = 1_000_000


def events_of(reasons: Sequence[int], limits: Sequence[int]) -> list[tuple[str, str]]:
    trace = TRACE.blank(len(reasons))
    trace["t_ns"] = np.arange(len(reasons)) * MS_NS
    trace["reason"], trace["limit"] = reasons, limits
    events = TripEvents()
    return [event for row in changes(trace, "reason") for event in events.news(trace[row])]


def test_a_trip_and_its_end_are_reported_once() -> None:
    reported = events_of([wire.HELD] * 5 + [wire.OPEN_LOOP] * 300 + [wire.HELD] * 5, [wire.NO_LIMIT] * 310)
    assert [code for code, _ in reported] == ["OPEN_LOOP", "CLEARED"]
    assert reported[0][1].startswith("failure: v_a fell by more than amplitude.gain_band")


def test_trips_that_alternate_do_not_flood_the_log_and_count_until_they_are_cleared() -> None:
    flicker = [wire.TRAVEL_END, wire.HELD, wire.NOISE, wire.HELD] * 1000
    codes = [code for code, _ in events_of([*flicker, wire.TRAVEL_END], [wire.NO_LIMIT] * 4001)]
    assert codes[:4] == ["TRAVEL_END", "CLEARED", "NOISE", "TRAVEL_END"]
    assert codes.count("CLEARED") == 4
    assert len(codes) <= 3 * codes.count("CLEARED") + 2
    assert codes[-1] == "TRAVEL_END"
    ended = [*flicker, wire.TRAVEL_END, *[wire.HELD] * 1000]  # an end within a second of the last is reported after it
    assert [code for code, _ in events_of(ended, [wire.NO_LIMIT] * len(ended))] == [*codes, "CLEARED"]


def test_the_end_of_the_exciter_is_reported_with_its_limit() -> None:
    (reported,) = events_of([wire.STICK_SEEN] * 5 + [wire.EXCITER_END] * 250, [wire.RANGE] * 255)
    assert reported[0] == "EXCITER_END"
    assert "cause: amplitude limited by limits.amplitude_max_m" in reported[1]


def test_every_trip_is_an_event_with_a_letter() -> None:
    assert all(EVENTS[code].letter in "FSM" and EVENTS[code].sources == "controller" for code in TRIPS)


def test_an_exciter_that_is_too_weak_is_an_event_of_the_log(tmp_path: Path) -> None:
    scenario = load_scenario("from-the-start", ["rig.piezo.delivered_ratio=0.05", "duration_s=2.5"])
    run_onboard(scenario, tmp_path / "run.mcap", {})
    codes = [event.code for event in read_run(tmp_path / "run.mcap").events if event.source == "controller"]
    assert codes == ["EXCITER_END", "END"]


@pytest.mark.slow
def test_a_drive_outside_of_its_travel_is_not_vibrated() -> None:
    came = suffer(lambda _block, _at, _memory: None, 3.7, controller={"limits": {"travel_m": [0.0, 1.25e-3]}})
    assert came.reasons["TRAVEL_END"] < 0.6
    assert came.at_end < 0.05


def test_blocks_that_come_later_than_before_are_late_once_that_lasts() -> None:
    age = Age()
    for block in range(100):
        age.note(5 * MS_NS + block * MS_NS, block * MS_NS)
    assert age.late_ns == 0
    late_ns = 5 * MS_NS + MARGIN_NS + MS_NS
    lates = []
    for block in range(100, 100 + HOLD_NS // MS_NS + 2):
        age.note(late_ns + block * MS_NS, block * MS_NS)
        lates.append(age.is_late)
    assert not any(lates[: HOLD_NS // MS_NS])
    assert lates[-1]
    age.note(5 * MS_NS + 400 * MS_NS, 400 * MS_NS)
    assert not age.is_late


def test_a_pause_that_is_made_up_for_and_two_clocks_that_drift_are_not_late() -> None:
    age = Age()
    for block in range(20_000):
        paused_ns = max(0, 150 - (block - 500)) * MS_NS if block >= 500 else 0
        age.note(MS_NS + round(block * MS_NS * 1.0001) + paused_ns, block * MS_NS)
        assert not age.is_late
