"""An exciter of any gain behind any delay: its gain is learnt, it is never overdriven, and its faults are reported."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from bridge.config import validate
from bridge.kernel import Record, kernel
from bridge.wire.messages import BLOCK, NO_BLOCK, RESET, sensor_block
from bridge.wire.stickslip_pb2 import CHECKING, OPEN_LOOP
from controller.config import ControllerConfig
from controller.exciter import begin_gain, listen, note_applied, note_check, restart_gain, stroke
from controller.limits import allow
from controller.policy.reason import WEAK_S
from controller.records import build
from controller.vibration import measure

WANTED_MPS, FREQUENCY_HZ = 6e-4, 2600.0
SILENT_S = 0.2
SILENT = 200  # steps of 1 ms
NOISE_MPS2 = 0.0015


def run(
    steps: int,
    delay: int,
    gain: Callable[[int], float],
    block_s: float = 1e-3,
    silent_s: float = SILENT_S,
    later: Callable[[int], int] = lambda _: 0,
    wanted: Callable[[int], float] = lambda _: WANTED_MPS,
    known_gain: float | None = None,
) -> tuple[Any, Any, Any]:
    """Parameters, memory, and true v_a of each step [m/s]: `silent_s` without, then with a vibration wanted.

    Args:
        steps: in all.
        delay: blocks by which exciter and accelerometer are late.
        gain: delivered over commanded amplitude at a step.
        block_s: length of a block.
        silent_s: from the start, in which the noise is learnt.
        later: blocks by which they are late beyond `delay`, at a step.
        wanted: v_a at a step [m/s], after the silence.
        known_gain: configured gain.

    """
    samples = round(block_s / 5e-5)
    limits = {"stale_after_s": 0.04, "slew_m_per_s": 1e-5}
    amplitude = {"known_gain": known_gain}
    config = {"block_s": block_s, "samples_per_block": samples, "limits": limits, "amplitude": amplitude}
    params, state = build(validate(ControllerConfig, config, "test"))
    p, s = params[0], state[0]
    silent = round(silent_s / block_s)
    begin_gain(p, s)
    s.in_force_s = 1.0
    p.frequency_Hz, s.held_mps = FREQUENCY_HZ, WANTED_MPS / 1.2
    arrives = np.array([max(step - delay - later(step), 0) for step in range(steps)])
    gains = np.array([gain(step) for step in range(steps)], float)
    wanted_mps = np.array([wanted(step) if step >= silent else 0.0 for step in range(steps)])
    noise = np.random.default_rng(1).normal(0.0, NOISE_MPS2, (steps, samples))
    true_mps = np.empty(steps)
    blocks = sensor_block(samples).blank(1)
    _steps(p, s, arrives, gains, wanted_mps, noise, blocks, true_mps)
    return p, s, true_mps


@kernel
def _steps(
    p: Record, s: Record, arrives: Any, gains: Any, wanted_mps: Any, noise: Any, blocks: Any, true_mps: Any
) -> None:
    """The loop and its exciter; `arrives` is the step whose command moves the base. In Python a step takes 0.3 ms."""
    block = blocks[0]
    omega = 2.0 * math.pi * p.frequency_Hz
    rolled_off = math.sqrt(1.0 + (p.frequency_Hz / p.accel_bandwidth_Hz) ** 2)
    steps, samples = noise.shape
    sent_m = np.zeros(steps + 1)
    heard_mps2 = np.empty(samples, np.float32)
    now_m = 0.0
    for step in range(steps):
        before_m, now_m = now_m, sent_m[arrives[step]] * gains[step]
        for i in range(samples):
            phase = omega * (samples * step + i + 1) * p.sample_s
            amplitude_m = before_m + (i + 1) / samples * (now_m - before_m)
            heard_mps2[i] = amplitude_m * omega**2 / rolled_off * math.cos(phase) + noise[step, i]
        block.sequence, block.applied_block = step + 5, step + 4
        block.applied_Hz, block.applied_m = p.frequency_Hz, sent_m[step]
        note_applied(p, s, block)
        measure(p, s, heard_mps2)
        listen(p, s)
        s.wanted_velocity_mps = wanted_mps[step]
        stroke(p, s)
        allow(p, s, BLOCK, p.frequency_Hz, s.wanted_m)
        sent_m[step + 1] = s.allowed_m
        s.steps += 1
        true_mps[step] = omega * now_m


@pytest.mark.parametrize("delay", [0, 2, 20, 50])
@pytest.mark.parametrize("gain", [0.5, 1.0, 10.0])
def test_the_gain_is_learnt_and_the_set_point_is_held(delay: int, gain: float) -> None:
    _, s, true_mps = run(SILENT + 1500, delay, lambda _: gain)
    assert s.gain == pytest.approx(gain, rel=0.02)
    assert s.known_gain == pytest.approx(gain, rel=0.02)
    assert true_mps[SILENT + 150 + delay :] == pytest.approx(WANTED_MPS, rel=0.02)


@pytest.mark.parametrize(("block_s", "delay"), [(2.5e-4, 100), (5e-3, 4), (10e-3, 5)])
@pytest.mark.parametrize("silent", [1, 12, 40])
def test_it_holds_with_short_and_long_blocks(block_s: float, delay: int, silent: int) -> None:
    steps = round(1.7 / block_s)
    _, _, true_mps = run(steps, delay, lambda _: 3.0, block_s, silent_s=silent * block_s)
    assert true_mps.max() < 1.3 * WANTED_MPS
    assert true_mps[-round(0.5 / block_s) :] == pytest.approx(WANTED_MPS, rel=0.02)


def test_a_configured_gain_is_used_from_the_first_block() -> None:
    _, _, true_mps = run(SILENT + 100, 0, lambda _: 3.0, known_gain=3.0)
    assert true_mps[SILENT + 40 :] == pytest.approx(WANTED_MPS, rel=0.02)


def longest(above: Any) -> int:
    edges = np.flatnonzero(np.diff(np.concatenate(([0], above.astype(int), [0]))))
    return int((edges[1::2] - edges[::2]).max(initial=0))


@pytest.mark.parametrize("delay", [0, 20, 50])
def test_the_first_start_on_a_mount_of_gain_ten_is_not_too_strong(delay: int) -> None:
    _, _, true_mps = run(SILENT + 600, delay, lambda _: 10.0)
    assert longest(true_mps > 1.3 * WANTED_MPS) <= 6


@pytest.mark.parametrize("delay", [0, 20])
@pytest.mark.parametrize("factor", [1.6, 5.0])
def test_a_gain_that_jumps_is_taken_back_within_25_ms_and_a_delay(delay: int, factor: float) -> None:
    jump = SILENT + 800
    _, s, true_mps = run(jump + 600, delay, lambda step: factor if step >= jump else 1.0)
    assert longest(true_mps > 1.3 * WANTED_MPS) <= 25 + delay
    assert true_mps[-100:] == pytest.approx(WANTED_MPS, rel=0.02)
    assert s.gain == pytest.approx(factor, rel=0.02)


@pytest.mark.parametrize("late", [5, 20, 48])
@pytest.mark.parametrize("gain", [0.5, 3.0])
def test_a_delay_that_changes_while_v_a_does_teaches_no_gain(late: int, gain: float) -> None:
    """It jumps up, and down again, and up at a third of the blocks, while the set point steps between 0.5 and 1 every 60 ms."""
    settled = SILENT + 800
    chance = np.random.default_rng(2)

    def later(step: int) -> int:
        if step < settled:
            return 0
        return late if step < settled + 700 else 0 if step < settled + 1000 else late * int(chance.random() < 0.3)

    def wanted(step: int) -> float:
        return WANTED_MPS * (0.5 if step > settled and step // 60 % 2 == 0 else 1.0)

    _, s, true_mps = run(settled + 1700, 0, lambda _: gain, later=later, wanted=wanted)
    assert s.gain == pytest.approx(gain, rel=0.02)
    assert true_mps[settled:].max() < 1.03 * WANTED_MPS
    assert true_mps[settled + 120 :].min() > 0.97 * 0.5 * WANTED_MPS


@pytest.mark.parametrize("late", [0, 20, 48])
@pytest.mark.parametrize("factor", [0.75, 1.25])
def test_a_gain_that_changes_is_learnt_whatever_the_delay_became(late: int, factor: float) -> None:
    """A vibration that no command of the last 65 ms explains halves within each 65 ms."""
    jump = SILENT + 800
    _, s, true_mps = run(
        jump + 500, 0, lambda step: factor if step >= jump else 1.0, later=lambda step: late if step >= jump else 0
    )
    assert true_mps[-100:] == pytest.approx(WANTED_MPS, rel=0.03)
    assert s.gain == pytest.approx(factor, rel=0.03)


def test_an_exciter_without_response_is_reported_and_driven_no_further_than_the_first_stroke() -> None:
    _, s, _ = run(SILENT + 1000, 0, lambda _: 0.0)
    assert s.weak_s > WEAK_S
    assert s.wanted_m == pytest.approx(0.1 * WANTED_MPS / (2.0 * math.pi * FREQUENCY_HZ))


@pytest.mark.parametrize("known_gain", [None, 2.0])
def test_a_lost_accelerometer_leaves_the_vibration_at_the_known_gain(known_gain: float | None) -> None:
    _, s, _ = run(SILENT + 1000, 0, lambda step: 2.0 if step < SILENT + 500 else 0.0, known_gain=known_gain)
    assert s.trip == OPEN_LOOP
    assert s.wanted_m == pytest.approx(0.5 * WANTED_MPS / (2.0 * math.pi * FREQUENCY_HZ), rel=0.03)


@pytest.mark.parametrize("factor", [0.65, 1.1, 3.0])
def test_a_gain_outside_of_its_band_is_limited_or_reported(factor: float) -> None:
    p, s, _ = run(SILENT + 1000, 0, lambda step: 1.0 if step < SILENT + 500 else factor)
    assert s.trip == 0
    assert s.banded == s.at_limit == (1 if factor == 0.65 else 0)
    assert s.resonates == (1 if factor == 3.0 else 0)
    if factor == 0.65:
        assert s.wanted_m == pytest.approx(p.gain_band * WANTED_MPS / (2.0 * math.pi * FREQUENCY_HZ), rel=0.03)


def test_a_warm_exciter_is_followed_to_its_floor_where_the_contact_agrees() -> None:
    p, s, _ = run(SILENT + 1000, 0, lambda step: 1.0 if step < SILENT + 500 else 0.65)
    s.stick_began, s.in_force_s, s.held_mps, s.vibration_velocity_mps = 1, 1.0, WANTED_MPS, WANTED_MPS
    stroke(p, s)
    assert s.banded == 1
    stroke(p, s)
    assert s.banded == 0
    assert s.wanted_m == pytest.approx(WANTED_MPS / 0.65 / (2.0 * math.pi * FREQUENCY_HZ), rel=0.02)
    s.gain, s.gain_off_s = 0.4, 0.01
    before = s.accepted_share
    stroke(p, s)  # a leap is a plug
    assert s.accepted_share == before
    s.gain, s.gain_off_s = 0.1, 0.0
    stroke(p, s)
    assert s.accepted_share == p.gain_floor


TONES_HZ = (1250.0, 2000.0, 2750.0, 3500.0, 4250.0)


def checked(gains: tuple[float, ...], **amplitude: float) -> tuple[Any, Any]:
    """Parameters and memory after the blocks that follow a check."""
    params, state = build(ControllerConfig.model_validate({"amplitude": amplitude}))
    p: Any = params[0]
    s: Any = state[0]
    p.accel_bandwidth_Hz = 1e9  # the accelerometer rolls nothing off
    begin_gain(p, s)
    block = sensor_block(20).blank(1)[0]
    for number in range(20):
        block["check_Hz"], block["check_gain"] = TONES_HZ[number % len(TONES_HZ)], gains[number % len(TONES_HZ)]
        note_check(p, s, block)
    return p, s


@pytest.mark.parametrize(
    ("gains", "configured", "known"),
    [
        ((0.8,) * 5, None, 0.8),
        ((0.5,) * 5, 1.0, 0.5),  # the check replaces the configured gain
        ((0.0,) * 5, 1.3, 1.3),  # a rig without a check
        ((1.0, 1.0, 4.0, 1.0, 1.0), None, 0.0),  # a mount that resonates: the first vibration decides
    ],
)
def test_the_known_gain_comes_from_the_check_then_from_the_configuration(
    gains: tuple[float, ...], configured: float | None, known: float
) -> None:
    amplitude = {} if configured is None else {"known_gain": configured}
    _, s = checked(gains, **amplitude)
    assert s.known_gain == pytest.approx(known)
    assert s.gain == pytest.approx(known or 10.0)


def test_a_check_forgets_the_gain_and_a_reset_restores_the_known_one() -> None:
    p, s = checked((0.8,) * 5)
    s.gain = 0.1
    restart_gain(p, s, RESET)
    assert s.gain == pytest.approx(0.8)
    s.guard_state = CHECKING
    restart_gain(p, s, 0)
    assert s.known_gain == 0.0


def test_the_loop_delay_is_the_age_of_the_commands_and_a_stall_does_not_change_it() -> None:
    p, s = checked((0.8,) * 5)
    block = sensor_block(20).blank(1)[0]
    block["applied_block"], block["fallback"] = NO_BLOCK, 1
    note_applied(p, s, block)
    assert s.loop_delay_steps == 0
    block["applied_Hz"], block["fallback"] = 2600.0, 0
    for number in range(100, 200):
        block["sequence"], block["applied_block"] = number, number - 21
        note_applied(p, s, block)
    assert s.loop_delay_steps == 20
    block["applied_block"] = 100
    note_applied(p, s, block)
    assert s.loop_delay_steps <= 21
