"""The amplitude loop with an exciter of any gain behind any delay: it learns the gain and never overdrives."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from bridge.config import validate
from bridge.kernel import Record, kernel
from bridge.wire.messages import BLOCK
from controller.amplitude import FIRST_SHARE, amplitude, listen, note_sent
from controller.config import ControllerConfig
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
) -> tuple[Any, Any, Any]:
    """Parameters, memory, and true v_a of each step [m/s]: `silent_s` without, then with a vibration wanted.

    Args:
        steps: in all.
        delay: blocks that a command takes besides the one in which it is given.
        gain: delivered over commanded amplitude at a step.
        block_s: length of a block.
        silent_s: from the start, in which the noise is learnt.
        later: blocks that a command takes beyond `delay`, at a step.
        wanted: v_a at a step [m/s], after the silence.

    """
    samples = round(block_s / 5e-5)
    limits = {"stale_after_s": 0.04, "slew_m_per_s": 1e-5}
    config = {"block_s": block_s, "samples_per_block": samples, "limits": limits}
    params, state = build(validate(ControllerConfig, config, "test"))
    p, s = params[0], state[0]
    silent = round(silent_s / block_s)
    s.silent_steps = p.silence_steps
    s.listening, s.onset_steps, s.loop_delay_steps, s.growth = 1, -1, -1, FIRST_SHARE
    s.candidate = int(np.argmin(np.abs(p.candidate_Hz - FREQUENCY_HZ)))
    s.wanted_Hz, s.tuned, s.held_mps = p.candidate_Hz[s.candidate], 1, WANTED_MPS / 1.2
    arrives = np.array([max(step - delay - later(step), 0) for step in range(steps)])
    gains = np.array([gain(step) for step in range(steps)], float)
    wanted_mps = np.array([wanted(step) if step >= silent else 0.0 for step in range(steps)])
    noise = np.random.default_rng(1).normal(0.0, NOISE_MPS2, (steps, samples))
    true_mps = np.empty(steps)
    _steps(p, s, arrives, gains, wanted_mps, noise, true_mps)
    return p, s, true_mps


@kernel
def _steps(p: Record, s: Record, arrives: Any, gains: Any, wanted_mps: Any, noise: Any, true_mps: Any) -> None:
    """The loop and its exciter; `arrives` is the step whose command moves the base. In Python a step takes 0.3 ms."""
    omega = 2.0 * math.pi * s.wanted_Hz
    rolled_off = math.sqrt(1.0 + (s.wanted_Hz / p.accel_bandwidth_Hz) ** 2)
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
        measure(p, s, heard_mps2)
        listen(p, s, False)
        s.wanted_velocity_mps = wanted_mps[step]
        amplitude(p, s)
        allow(p, s, BLOCK, s.wanted_Hz, s.wanted_m)
        note_sent(p, s)
        sent_m[step + 1] = s.allowed_m
        s.steps += 1
        true_mps[step] = omega * now_m


@pytest.mark.parametrize("delay", [0, 2, 20, 50])
@pytest.mark.parametrize("gain", [0.5, 1.0, 10.0])
def test_delay_and_gain_are_learnt_and_the_set_point_is_held(delay: int, gain: float) -> None:
    _, s, true_mps = run(SILENT + 1500, delay, lambda _: gain)
    assert s.loop_delay_steps == pytest.approx(delay, abs=1)
    assert math.exp(s.log_gain[s.candidate]) == pytest.approx(gain, rel=0.02)
    from_step = SILENT + 150 + 12 * delay
    assert true_mps[from_step:] == pytest.approx(WANTED_MPS, rel=0.02)


@pytest.mark.parametrize(("block_s", "delay"), [(2.5e-4, 100), (5e-3, 4), (10e-3, 5)])
def test_it_holds_with_short_and_long_blocks(block_s: float, delay: int) -> None:
    steps = round((SILENT_S + 1.5) / block_s)
    _, s, true_mps = run(steps, delay, lambda _: 3.0, block_s)
    assert s.loop_delay_steps == pytest.approx(delay, abs=max(1, round(1e-3 / block_s)))
    assert true_mps[-round(0.5 / block_s) :] == pytest.approx(WANTED_MPS, rel=0.02)


@pytest.mark.parametrize(("block_s", "delay"), [(2.5e-4, 40), (1e-3, 10), (1e-3, 0), (10e-3, 5)])
@pytest.mark.parametrize("silent", [1, 4, 12])
def test_noise_teaches_no_delay_where_the_vibration_begins_early(block_s: float, delay: int, silent: int) -> None:
    """Quiet blocks; blocks before the vibration arrives count as noise too."""
    _, s, true_mps = run(round(1.5 / block_s), delay, lambda _: 3.0, block_s, silent_s=silent * block_s)
    assert s.loop_delay_steps == pytest.approx(delay, abs=max(1, round(1e-3 / block_s)))
    assert true_mps.max() < 1.3 * WANTED_MPS
    assert true_mps[-round(0.5 / block_s) :] == pytest.approx(WANTED_MPS, rel=0.02)


def longest(above: Any) -> int:
    edges = np.flatnonzero(np.diff(np.concatenate(([0], above.astype(int), [0]))))
    return int((edges[1::2] - edges[::2]).max(initial=0))


@pytest.mark.parametrize("delay", [0, 20, 50])
def test_the_first_start_on_a_mount_of_gain_ten_is_not_too_strong(delay: int) -> None:
    _, _, true_mps = run(SILENT + 600, delay, lambda _: 10.0)
    assert longest(true_mps > 1.3 * WANTED_MPS) <= 6


@pytest.mark.parametrize("delay", [0, 20])
@pytest.mark.parametrize("factor", [1.6, 5.0])
def test_a_gain_that_jumps_is_taken_back_within_a_delay(delay: int, factor: float) -> None:
    jump = SILENT + 800
    _, s, true_mps = run(jump + 600, delay, lambda step: factor if step >= jump else 1.0)
    assert longest(true_mps > 1.3 * WANTED_MPS) <= 6 + delay
    assert true_mps[-100:] == pytest.approx(WANTED_MPS, rel=0.02)
    assert math.exp(s.log_gain[s.candidate]) == pytest.approx(factor, rel=0.02)


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
    assert math.exp(s.log_gain[s.candidate]) == pytest.approx(gain, rel=0.02)
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
    assert math.exp(s.log_gain[s.candidate]) == pytest.approx(factor, rel=0.03)


def test_a_late_block_teaches_nothing() -> None:
    p, s, _ = run(SILENT + 400, 0, lambda _: 1.0)
    before = (s.log_gain[s.candidate], s.noise_mps, s.loop_delay_steps)
    for _ in range(300):  # as a rig shows them that makes up for a pause: full v_a after 0.3 s of no command
        s.allowed_m = 0.0
        note_sent(p, s)
        s.steps += 1
        listen(p, s, True)
    assert (s.log_gain[s.candidate], s.noise_mps, s.loop_delay_steps) == before


def test_an_exciter_without_response_is_reported_and_driven_no_further_than_the_model() -> None:
    _, s, _ = run(SILENT + 1000, 0, lambda _: 0.0)
    assert s.weak_s > WEAK_S
    assert s.wanted_m == pytest.approx(WANTED_MPS / (2.0 * math.pi * s.wanted_Hz))


def test_a_lost_accelerometer_is_reported() -> None:
    _, s, _ = run(SILENT + 1000, 0, lambda step: 1.0 if step < SILENT + 500 else 0.0)
    assert s.weak_s > WEAK_S
    assert math.exp(s.log_gain[s.candidate]) == pytest.approx(1.0, rel=0.05)  # as learnt before
