"""What a run's sensors say of themselves: sound logs stay without a finding, broken channels are found, three witnesses agree."""

import itertools
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bridge.log.log_reader import LogReader
from bridge.log.logfile import RunData, iter_pieces, read_run
from cockpit.judge.described import described
from cockpit.judge.sensor_watch import SensorVerdict, SensorWatch
from tests.logs import cycles_of

GOLDEN = Path(__file__).parents[2] / "golden"
FORCE, SLIDE_MPS2, BASE_MPS2 = "drive_force_N", "mass_accel_mps2", "base_accel_mps2"
SLIDE, DRIVE = "mass_position_m", "drive_position_m"
CHANNELS = {"force": FORCE, "slide accel": SLIDE_MPS2, "base accel": BASE_MPS2, "slide": SLIDE, "drive": DRIVE}
TOPICS = "applied", "trace"


@cache
def golden(name: str) -> RunData:
    return read_run(GOLDEN / f"{name}.mcap")


def watched(run: RunData, step: int = 997) -> SensorVerdict:
    """What the watch finds in a log that was read, fed in pieces of so many messages."""
    watch = SensorWatch(described(run.configuration("plant"), run.configuration("controller")))
    for begin in range(0, len(run.sensors), step):
        watch.sensors(run.sensors[begin : begin + step])
        for topic in TOPICS:
            getattr(watch, topic)(getattr(run, topic)[begin : begin + step])
    cycles = cycles_of(run)
    return watch.result(cycles.breakaway_t_s if cycles is not None else None)


def with_channels(run: RunData, change: Callable[[Any], None]) -> RunData:
    sensors = run.sensors.copy()
    change(sensors)
    return run._replace(sensors=sensors)


@pytest.mark.parametrize("name", sorted(path.stem for path in GOLDEN.glob("*.mcap")))
def test_a_sound_log_is_without_a_finding(name: str) -> None:
    seen = watched(golden(name))
    assert seen.findings == []
    assert not any(found.decides for found in seen.findings)


def test_three_witnesses_count_the_same_slips() -> None:
    run = golden("slip-then-control")
    watch = SensorWatch(described(run.configuration("plant"), run.configuration("controller")))
    for piece in iter_pieces(LogReader(run.path)):
        if piece.topic in {"sensors", *TOPICS}:
            getattr(watch, piece.topic)(piece.records)
    cycles = cycles_of(run)
    assert cycles is not None
    assert cycles.slips > 1
    watch.result(cycles.breakaway_t_s)
    assert watch.place_slips is not None
    place_s, trace_s = watch.place_slips.times.all(), watch.trace_slips.slips.all()
    assert len(place_s) == cycles.slips
    assert abs(len(trace_s) - cycles.slips) <= 1
    assert place_s == pytest.approx(cycles.breakaway_t_s, abs=0.05)


def test_pieces_of_any_size_say_the_same() -> None:
    run = golden("slip-then-control")
    assert watched(run, 61) == watched(run, 100_000)


def stands(name: str) -> Callable[[Any], None]:
    def change(sensors: Any) -> None:
        sensors[name] = np.median(sensors[name])

    return change


def stops(name: str) -> Callable[[Any], None]:
    def change(sensors: Any) -> None:
        half = len(sensors) // 2
        sensors[name][half:] = sensors[name][half, -1]

    return change


def repeats(name: str) -> Callable[[Any], None]:
    def change(sensors: Any) -> None:
        half = len(sensors) // 2
        sensors[name][half:] = sensors[name][half]

    return change


def is_zero(name: str) -> Callable[[Any], None]:
    return lambda sensors: sensors[name].fill(0.0)


def is_no_number(name: str) -> Callable[[Any], None]:
    return lambda sensors: sensors[name].fill(np.nan)


def clips(name: str) -> Callable[[Any], None]:
    def change(sensors: Any) -> None:
        most = np.float32(0.6 * sensors[name].max())
        np.clip(sensors[name], -most, most, out=sensors[name])

    return change


BROKEN = {
    f"{word} {how.__name__}": how(name)
    for word, name in CHANNELS.items()
    for how in (stands, stops, repeats, is_zero, is_no_number, clips)
}


@pytest.mark.parametrize("change", BROKEN.values(), ids=BROKEN)
def test_a_dead_clipped_or_missing_channel_is_not_judged(change: Callable[[Any], None]) -> None:
    assert any(found.decides for found in watched(with_channels(golden("slip-then-control"), change)).findings)


def swap(one: str, other: str, share: float = 0.0) -> Callable[[Any], None]:
    def change(sensors: Any) -> None:
        begin = int(share * len(sensors))
        kept = sensors[one][begin:].copy()
        sensors[one][begin:] = sensors[other][begin:]
        sensors[other][begin:] = kept

    return change


SWAPPED = {
    f"{one} and {other}": swap(CHANNELS[one], CHANNELS[other]) for one, other in itertools.combinations(CHANNELS, 2)
} | {
    f"{one} and {other}, later": swap(CHANNELS[one], CHANNELS[other], 0.5)
    for one, other in itertools.combinations(CHANNELS, 2)
}


@pytest.mark.parametrize("change", SWAPPED.values(), ids=SWAPPED)
def test_two_swapped_channels_are_not_judged(change: Callable[[Any], None]) -> None:
    assert any(found.decides for found in watched(with_channels(golden("slip-then-control"), change)).findings)


@pytest.mark.parametrize("factor", [-1.0, 0.1, 0.2248, 4.448, 1000.0])
@pytest.mark.parametrize("name", [FORCE, SLIDE, DRIVE])
def test_a_channel_of_another_sign_or_scale_is_not_judged(name: str, factor: float) -> None:
    def change(sensors: Any) -> None:
        sensors[name] *= np.float32(factor)

    seen = watched(with_channels(golden("slip-then-control"), change))
    assert any(found.decides for found in seen.findings)
    assert {finding.code for finding in seen.findings} & {
        "SENSOR_SCALE",
        "SENSOR_SWAPPED",
        "SENSOR_CLIPPED",
        "SENSOR_OTHER",
    }


def test_a_force_that_shows_no_slip_disagrees_with_the_other_witnesses() -> None:
    """The severe case: a sensor of 5 N on an axis that needs 17 N, whose noise goes on at the end of its range."""

    def change(sensors: Any) -> None:
        noise_N = 0.02 * np.random.default_rng(1).standard_normal(sensors[FORCE].shape)
        sensors[FORCE] = (5.0 + noise_N).astype(np.float32)

    run = with_channels(golden("slip-then-control"), change)
    seen = watched(run)
    assert any(found.decides for found in seen.findings)
    assert "SLIPS_DISAGREE" in {finding.code for finding in seen.findings}


def test_channels_that_do_not_decide_are_named_and_leave_the_verdict() -> None:
    """A rig whose controller uses no force, and one that describes no sensor and has no accelerometer on its slide."""
    run = with_channels(golden("slip-then-control"), is_zero(FORCE))
    controller = run.configuration("controller")
    controller["estimator"] |= {"use_force": False}
    of = described(run.configuration("plant"), controller)
    watch = SensorWatch(of)
    watch.sensors(run.sensors)
    assert [(one.code, one.decides) for one in watch.result().findings] == [("SENSOR_ABSENT", False)]
    foreign = described(None, run.configuration("controller"))
    watch = SensorWatch(foreign)
    watch.sensors(with_channels(golden("slip-then-control"), is_zero(SLIDE_MPS2)).sensors)
    assert [(one.code, one.decides) for one in watch.result().findings] == [("SENSOR_ABSENT", False)]
