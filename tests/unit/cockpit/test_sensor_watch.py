"""Sensor checks of a run: sound logs have no finding, broken channels are found, three witnesses agree."""

import itertools
import json
import math
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bridge.log.check.channel import channels_of
from bridge.log.logfile import RunData, read_run
from bridge.wire import stickslip_pb2 as wire
from cockpit.judge import judged
from cockpit.judge.judged import judge_log
from cockpit.judge.sensor_watch import ChannelRelations, SensorVerdict
from cockpit.judge.setup import described
from cockpit.judge.verdict_words import in_words
from cockpit.judge.window import APPLIED_ROW, TRACE_ROW, JudgedBlocks, Window
from plant.config import SensorsConfig
from tests.channel_edits import edited, edits_of
from tests.logs import verdict_of

GOLDEN = Path(__file__).parents[2] / "golden"
FORCE, SLIDE_MPS2, BASE_MPS2 = "drive_force_N", "mass_accel_mps2", "base_accel_mps2"
SLIDE, DRIVE = "mass_position_m", "drive_position_m"
PAPER = channels_of({"rig": {"sensors": SensorsConfig().model_dump()}})
CHANNELS = {"force": FORCE, "slide accel": SLIDE_MPS2, "base accel": BASE_MPS2, "slide": SLIDE, "drive": DRIVE}


@cache
def golden(name: str) -> RunData:
    return read_run(GOLDEN / f"{name}.mcap")


def watched(run: RunData) -> SensorVerdict:
    """The judge's sensor verdict on a log."""
    sensors = verdict_of(run).sensors
    assert sensors is not None
    return sensors


def with_channels(run: RunData, change: Callable[[Any], None]) -> RunData:
    sensors = run.sensors.copy()
    change(sensors)
    return run._replace(sensors=sensors)


@pytest.mark.parametrize("name", sorted(path.stem for path in GOLDEN.glob("*.mcap")))
def test_a_sound_log_is_without_a_finding(name: str) -> None:
    seen = watched(golden(name))
    assert seen.findings == []
    assert not any(finding.decides for finding in seen.findings)


def test_three_witnesses_count_the_same_slips() -> None:
    run = golden("slip-then-control")
    judge = judge_log(run.path).judge
    assert judge.cycles is not None
    assert judge._begun is not None
    verdict = judge._begun[2].sensors.result(judge.cycles.breakaway_t_s, [(0.0, math.inf)])
    assert verdict is not None
    assert verdict.by_force > 1
    assert verdict.by_position == verdict.by_force
    assert abs(verdict.by_trace - verdict.surges - verdict.by_force) <= 1


def test_pieces_of_any_size_give_the_same_findings(monkeypatch: pytest.MonkeyPatch) -> None:
    run = golden("slip-then-control")
    findings = watched(run)
    for rows in (61, 997):
        monkeypatch.setattr(judged, "_PIECE_ROWS", rows)
        assert watched(run) == findings


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


def is_no_number(name: str) -> Callable[[Any], None]:
    return lambda sensors: sensors[name].fill(np.nan)


def of_edits(name: str, word: str, from_share: float = 0.0) -> Callable[[Any], None]:
    edit = edits_of(name, PAPER[name])[word]
    return lambda sensors: edit(sensors, int(from_share * len(sensors)))


BROKEN = {
    f"{word} {how.__name__}": how(name) for word, name in CHANNELS.items() for how in (stops, repeats, is_no_number)
} | {f"{word} {how}": of_edits(name, how) for word, name in CHANNELS.items() for how in ("zero", "stuck", "clipped")}


@pytest.mark.parametrize("change", BROKEN.values(), ids=BROKEN)
def test_a_dead_clipped_or_missing_channel_is_not_judged(change: Callable[[Any], None]) -> None:
    assert any(finding.decides for finding in watched(with_channels(golden("slip-then-control"), change)).findings)


SWAPPED = {
    f"{one} and {other}{later}": of_edits(CHANNELS[one], f"swapped with {CHANNELS[other]}", share)
    for one, other in itertools.combinations(CHANNELS, 2)
    for later, share in (("", 0.0), (", later", 0.5))
}


@pytest.mark.parametrize("change", SWAPPED.values(), ids=SWAPPED)
def test_two_swapped_channels_are_not_judged(change: Callable[[Any], None]) -> None:
    assert any(finding.decides for finding in watched(with_channels(golden("slip-then-control"), change)).findings)


@pytest.mark.parametrize("factor", [-1.0, 0.1, 0.2248, 4.448, 1000.0])
@pytest.mark.parametrize("name", [FORCE, SLIDE, DRIVE])
def test_a_channel_of_another_sign_or_scale_is_not_judged(name: str, factor: float) -> None:
    def change(sensors: Any) -> None:
        sensors[name] *= np.float32(factor)

    seen = watched(with_channels(golden("slip-then-control"), change))
    assert any(finding.decides for finding in seen.findings)
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
    assert any(finding.decides for finding in seen.findings)
    assert "SLIPS_DISAGREE" in {finding.code for finding in seen.findings}


def test_channels_that_do_not_decide_are_named_and_leave_the_verdict() -> None:
    """On a rig without a description: a force that its controller does not use, and the accelerometer on its slide."""
    for name in (FORCE, SLIDE_MPS2):
        run = with_channels(golden("slip-then-control"), of_edits(name, "zero"))
        controller = run.configuration("controller")
        controller["estimator"] |= {"use_force": name != FORCE}
        described = {**run.headers, "controller": {"configuration": json.dumps(controller)}}
        alone = {role: table for role, table in described.items() if role != "plant"}
        findings = [watched(run._replace(headers=headers)).findings for headers in (described, alone)]
        assert ("SENSOR_DEAD", True) in [(one.code, one.decides) for one in findings[0]]
        assert [(one.code, one.decides) for one in findings[1]] == [("SENSOR_DEAD", False)]


def test_a_force_whose_noise_hides_a_slip_is_not_judged() -> None:
    def change(sensors: Any) -> None:
        sensors[FORCE] += 20.0 * np.random.default_rng(1).standard_normal(sensors[FORCE].shape).astype(np.float32)

    verdict = verdict_of(with_channels(golden("slip-then-control"), change))
    assert any(line.startswith("SENSOR_NOISE: ") for line in verdict.blind)
    assert sum("slips cannot be judged in" in line for line in in_words(verdict, verbose=False)) == 2


def test_accelerometers_that_are_swapped_for_the_controller_too_are_seen() -> None:
    run = golden("slip-then-control")
    base_mps2 = run.sensors[BASE_MPS2].copy()

    def swap(sensors: Any) -> None:
        sensors[BASE_MPS2], sensors[SLIDE_MPS2] = run.sensors[SLIDE_MPS2], base_mps2

    trace = run.trace.copy()  # the controller sees the slide's vibration as v_a
    at = np.searchsorted(run.sensors["sequence"], trace["block"])
    trace["vibration_velocity_mps"] *= run.sensors[SLIDE_MPS2][at].std(axis=1) / base_mps2[at].std(axis=1).clip(1e-9)
    findings = watched(with_channels(run._replace(trace=trace), swap)).findings
    assert any(one.code == "SENSOR_SWAPPED" and "more than base_accel_mps2" in one.text for one in findings)


@pytest.mark.parametrize("share", [0.0, 0.5])
@pytest.mark.parametrize(("name", "other"), [(SLIDE, DRIVE), (DRIVE, SLIDE)])
def test_positions_that_go_alike_while_the_force_varies_are_not_judged(name: str, other: str, share: float) -> None:
    findings = watched(with_channels(golden("slip-then-control"), of_edits(name, f"copy of {other}", share))).findings
    assert ("SENSOR_SCALE", True) in {(one.code, one.decides) for one in findings}


@pytest.mark.parametrize(("name", "code"), [(BASE_MPS2, "SENSOR_SWAPPED"), (SLIDE_MPS2, "SENSOR_DEAD")])
def test_an_accelerometer_that_shows_its_noise_in_the_last_second_is_not_judged(name: str, code: str) -> None:
    run = golden("slip-then-control")
    last_s = float(run.sensors["t_ns"][-1]) * 1e-9 - 1.0
    findings = watched(edited(run, edits_of(name, PAPER[name])["noise"], last_s)).findings
    assert [(one.code, one.decides) for one in findings] == [(code, True)]


def test_a_slide_that_a_fast_drive_leaves_at_rest_under_vibration_is_sound() -> None:
    """Friction reverses only where v_a exceeds v_d: noise of the slide at 10 times the v_d was SENSOR_DEAD."""
    run = golden("slip-then-control")
    last_s = float(run.sensors["t_ns"][-1]) * 1e-9 - 1.0
    trace = run.trace.copy()
    trace["drive_velocity_mps"] *= 10.0
    assert (
        watched(edited(run, edits_of(SLIDE_MPS2, PAPER[SLIDE_MPS2])["noise"], last_s)._replace(trace=trace)).findings
        == []
    )


def test_a_slow_accelerometer_that_the_controller_corrects_is_sound() -> None:
    """The remedy of a refusal, `controller.amplitude.accel_bandwidth_Hz`: it was SENSOR_OTHER."""
    run = golden("slip-then-control")
    frequency_Hz = run.applied["frequency_Hz"].max()
    rolled_off = np.float32(np.hypot(1.0, frequency_Hz / 1e4) / np.hypot(1.0, frequency_Hz / 900.0))

    def slow(sensors: Any) -> None:
        for name in (BASE_MPS2, SLIDE_MPS2):
            sensors[name] *= rolled_off

    controller = run.configuration("controller")
    controller["amplitude"]["accel_bandwidth_Hz"] = 900.0
    headers = {**run.headers, "controller": {"configuration": json.dumps(controller)}}
    for table, codes in ((run.headers, {"SENSOR_OTHER"}), (headers, set())):
        findings = watched(with_channels(run._replace(headers=table), slow)).findings
        assert {finding.code for finding in findings} == codes


def codes_of(step_m: float = 0.0, v_a_mps: float = 0.0, **columns: Any) -> list[str]:
    """Of the relations that do not hold in 20 s of vibration at 4 kHz, 10 m/s2, with a drive that creeps."""
    count = 20_000
    number, omega = np.arange(count), 2.0 * np.pi * 4000.0
    applied = np.zeros(count, APPLIED_ROW)
    applied["sequence"], applied["frequency_Hz"], applied["amplitude_m"] = number, 4000.0, 10.0 / omega**2
    place_m = np.linspace(0.0, 2e-4, count)[:, None]
    blocks = JudgedBlocks(
        number, number * 1_000_000, np.full((count, 1), 13.0), place_m, place_m - 1e-3, *np.ones((2, count))
    )
    blocks = blocks._replace(**columns)
    if step_m:
        blocks = blocks._replace(
            **{name: step_m * np.round(getattr(blocks, name) / step_m) for name in ("drive_m", "slide_m")}
        )
    rig = {"sensors": SensorsConfig(position_resolution_m=step_m).model_dump(), "drive": {"stiffness_N_per_m": 1.2e4}}
    relations = ChannelRelations(described({"rig": rig}, {}), 1e-3)
    trace = np.zeros(count, TRACE_ROW)
    trace["block"], trace["mode"], trace["vibration_velocity_mps"] = number, wire.EXCITE, v_a_mps
    relations.add(Window(blocks, trace, applied, 0, count, 0, False, 0, is_last=True))
    return [doubt.code for doubt in relations.doubts()]


def test_one_second_of_noise_in_a_long_run_is_a_doubt() -> None:
    base_mps2 = np.full(20_000, 7.0)
    assert codes_of(base_mps2=base_mps2) == []
    base_mps2[-600:] = 0.0015
    assert codes_of(base_mps2=base_mps2) == ["SENSOR_SWAPPED"]


def test_the_noise_of_a_dead_exciter_is_not_compared() -> None:
    """The noise of the base was SENSOR_OTHER, a noisier slide SENSOR_SWAPPED."""
    noise_mps2 = np.full(20_000, 0.0015)
    assert codes_of(v_a_mps=2e-9, base_mps2=noise_mps2, slide_mps2=2.0 * noise_mps2) == []
    assert codes_of(v_a_mps=4e-4, base_mps2=noise_mps2, slide_mps2=2.0 * noise_mps2) == [
        "SENSOR_SWAPPED",
        "SENSOR_OTHER",
    ]


def test_positions_of_coarse_steps_that_are_described_are_sound() -> None:
    assert codes_of(step_m=3e-6) == []


def test_the_control_line_names_a_gain_that_nothing_confirmed() -> None:
    verdict = verdict_of(golden("stop-and-go"))
    assert in_words(verdict, verbose=False)[1] == "control  ok; the exciter's gain was not verified"
    assert in_words(verdict._replace(gain_verified=True), verbose=False)[1] == "control  ok"


@pytest.mark.parametrize("role", ["plant", "recorder"])
@pytest.mark.parametrize(
    ("given_N_per_m", "warned"), [(3.0, True), (8e3, False), (2e4, False), (1e5, True), (1e99, True)]
)
def test_a_configured_stiffness_far_from_the_slope_of_the_force_is_a_warning(
    given_N_per_m: float, warned: bool, role: str
) -> None:
    """Also a k_d that the controller does not learn: a value thousands of times too small had no warning."""
    run = golden("slip-then-control")
    controller = run.configuration("controller") | {"drive_stiffness_N_per_m": given_N_per_m}
    headers = {**run.headers, "controller": {"configuration": json.dumps(controller)}}
    headers = {name: table for name, table in headers.items() if name != "plant" or role == "plant"}
    trace = run.trace.copy()
    trace["drive_stiffness_sigma"] = 0.5
    verdict = verdict_of(run._replace(headers=headers, trace=trace))
    line = f"controller.drive_stiffness_N_per_m = {given_N_per_m:.3g}: the run shows 1.16e+04, more than a factor of 2"
    assert [warning.partition(" away")[0] for warning in verdict.warnings] == [line] * warned
