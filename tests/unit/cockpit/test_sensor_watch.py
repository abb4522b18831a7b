"""What a run's sensors say of themselves: sound logs stay without a finding, broken channels are found, three witnesses agree."""

import itertools
import json
import math
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bridge.log.logfile import RunData, read_run
from cockpit.judge import judged
from cockpit.judge.judged import judge_log
from cockpit.judge.sensor_watch import SensorVerdict
from tests.logs import verdict_of

GOLDEN = Path(__file__).parents[2] / "golden"
FORCE, SLIDE_MPS2, BASE_MPS2 = "drive_force_N", "mass_accel_mps2", "base_accel_mps2"
SLIDE, DRIVE = "mass_position_m", "drive_position_m"
CHANNELS = {"force": FORCE, "slide accel": SLIDE_MPS2, "base accel": BASE_MPS2, "slide": SLIDE, "drive": DRIVE}


@cache
def golden(name: str) -> RunData:
    return read_run(GOLDEN / f"{name}.mcap")


def watched(run: RunData) -> SensorVerdict:
    """What the judge finds in a log that was read."""
    found = verdict_of(run).sensors
    assert found is not None
    return found


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
    judge = judge_log(run.path).judge
    verdict = judge.sensors_in([(0.0, math.inf)])
    assert verdict is not None
    assert verdict.by_force > 1
    assert verdict.by_position == verdict.by_force
    assert abs(verdict.by_trace - verdict.surges - verdict.by_force) <= 1


def test_pieces_of_any_size_say_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    run = golden("slip-then-control")
    found = watched(run)
    for rows in (61, 997):
        monkeypatch.setattr(judged, "_PIECE_ROWS", rows)
        assert watched(run) == found


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
    run = run._replace(headers={**run.headers, "controller": {"configuration": json.dumps(controller)}})
    assert [(one.code, one.decides) for one in watched(run).findings] == [("SENSOR_DEAD", False)]
    run = with_channels(golden("slip-then-control"), is_zero(SLIDE_MPS2))
    run = run._replace(headers={name: table for name, table in run.headers.items() if name != "plant"})
    assert [(one.code, one.decides) for one in watched(run).findings] == [("SENSOR_DEAD", False)]


def test_a_force_whose_noise_hides_a_slip_is_not_judged() -> None:
    def change(sensors: Any) -> None:
        sensors[FORCE] += 20.0 * np.random.default_rng(1).standard_normal(sensors[FORCE].shape).astype(np.float32)

    found = watched(with_channels(golden("slip-then-control"), change)).findings
    assert ("SENSOR_NOISE", True) in {(one.code, one.decides) for one in found}


def test_accelerometers_that_are_swapped_for_the_controller_too_are_seen() -> None:
    run = golden("slip-then-control")
    base_mps2 = run.sensors[BASE_MPS2].copy()

    def swap(sensors: Any) -> None:
        sensors[BASE_MPS2], sensors[SLIDE_MPS2] = run.sensors[SLIDE_MPS2], base_mps2

    trace = run.trace.copy()  # the controller sees the slide's vibration as v_a
    at = np.searchsorted(run.sensors["sequence"], trace["block"])
    trace["vibration_velocity_mps"] *= run.sensors[SLIDE_MPS2][at].std(axis=1) / base_mps2[at].std(axis=1).clip(1e-9)
    found = watched(with_channels(run._replace(trace=trace), swap)).findings
    assert any(one.code == "SENSOR_SWAPPED" and "vibrates more than the base" in one.text for one in found)
