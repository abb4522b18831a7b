"""The states of a rig, and the loop check that precedes ARMED."""

import math
from typing import Any

import pytest

from bridge.guard.check import follow_check, gain_change, gain_report
from bridge.guard.config import GuardConfig, Level
from bridge.guard.core import NO_COMMAND
from bridge.guard.records import FIRST, build
from bridge.guard.states import ACCEPT_GAIN, ARM, DISARM, HOLD, LEAVE, RESET, STOP, apply_order, enter, trip
from bridge.wire.messages import sensor_block
from bridge.wire.stickslip_pb2 import (
    ACTIVE,
    ARMED,
    ARMED_BY_PERSON,
    CHECK_PASSED,
    CHECKING,
    COMMAND_LOST,
    DISARMED,
    DISARMED_BY_PERSON,
    DRIVE_MAX,
    ENABLE_DEAD,
    EXCITER_SILENT,
    FAULT,
    FIRST_CHECK,
    GAIN_ACCEPTED,
    GAIN_CHANGED,
    GAIN_UNEXPECTED,
    LOUD,
    OVERTRAVEL,
    POWER_UP,
    READY,
    RESET_BY_PERSON,
    RUN_ENDED,
    SENSOR_FROZEN,
    SENSOR_NOT_FINITE,
    STOP_BY_PERSON,
    STOP_KEPT,
)
from tests.unit.bridge.guard.rigs import EXCITER, NANO, Rig, real

QUIET, BLOCKS = 200 + 500, 200 + 500 + 5 * 200  # blocks of the check up to its first tone, and up to its end


@pytest.mark.parametrize(
    ("state", "word", "after", "cause"),
    [
        (DISARMED, ARM, CHECKING, ARMED_BY_PERSON),
        (ARMED, ARM, CHECKING, ARMED_BY_PERSON),  # that its scenario armed, without a check
        (READY, ARM, CHECKING, ARMED_BY_PERSON),
        (READY, ACCEPT_GAIN, ARMED, GAIN_ACCEPTED),
        (FAULT, RESET, DISARMED, RESET_BY_PERSON),
        (ACTIVE, DISARM, DISARMED, DISARMED_BY_PERSON),
        (CHECKING, DISARM, DISARMED, DISARMED_BY_PERSON),
        (ACTIVE, LEAVE, DISARMED, RUN_ENDED),
        *((state, STOP, FAULT, STOP_BY_PERSON) for state in (DISARMED, CHECKING, READY, ARMED, ACTIVE)),
    ],
)
def test_a_word_leads_from_state_to_state(state: int, word: int, after: int, cause: int) -> None:
    rig = Rig(arm=False)
    rig.s.state = state
    assert apply_order(rig.s, word)
    assert (rig.s.state, rig.s.cause) == (after, cause)


@pytest.mark.parametrize(
    ("state", "word"),
    [
        (FAULT, ARM),
        (FAULT, DISARM),
        (FAULT, LEAVE),
        (ARMED, ARM),
        (ACTIVE, ARM),
        (CHECKING, ARM),
        (DISARMED, DISARM),
        (DISARMED, LEAVE),
        (ACTIVE, RESET),
        (DISARMED, RESET),
        (ACTIVE, 0),
        (ACTIVE, 99),
    ],
)
def test_other_words_change_nothing(state: int, word: int) -> None:
    rig = Rig(arm=False)
    rig.s.state, rig.s.verified = state, 1
    assert not apply_order(rig.s, word)
    assert (rig.s.state, rig.s.cause) == (state, POWER_UP)


def test_a_stop_is_taken_in_fault_too_and_the_first_cause_of_a_fault_stays_otherwise() -> None:
    rig = Rig()
    trip(rig.s, LOUD)
    trip(rig.s, SENSOR_FROZEN)
    assert (rig.s.state, rig.s.cause) == (FAULT, LOUD)
    assert apply_order(rig.s, STOP)
    assert rig.s.cause == STOP_BY_PERSON


def test_a_new_state_resets_the_counters_of_the_state_and_the_same_state_does_not() -> None:
    rig = Rig()
    for state, left in ((ARMED, 3), (DISARMED, 0)):
        rig.s.lost_blocks = rig.s.check_blocks = rig.s.heard = 3
        rig.s.over_blocks[:] = 3
        enter(rig.s, state, COMMAND_LOST)
        assert (rig.s.lost_blocks, rig.s.check_blocks, rig.s.heard) == (left, left, left)
        assert set(rig.s.over_blocks) == {left}


def test_a_stop_that_was_kept_holds_at_power_up_even_where_the_scenario_arms() -> None:
    _, state = build(real(GuardConfig()), EXCITER, 1, arm=True)
    assert apply_order(state[0], HOLD)
    assert (state[0].state, state[0].cause) == (FAULT, STOP_KEPT)


def test_the_check_measures_the_gain_and_arms() -> None:
    rig = Rig(arm=False)
    rig.gain = 0.7
    apply_order(rig.s, ARM)
    for _ in range(200):
        rig.block(NO_COMMAND)
        assert (rig.s.state, rig.s.enable) == (CHECKING, 0)
        assert rig.s.amplitude_m > 0.0
    for block in range(500):
        rig.block(NO_COMMAND)
        assert rig.s.state == CHECKING
        assert rig.s.enable == (rig.s.amplitude_m == 0.0) == (block >= 9)
    rig.block(NO_COMMAND)
    assert rig.s.amplitude_m > 0.0  # the first tone begins at once
    for _ in range(5 * 200 + 9):  # the last tone fades before the rig is ARMED
        assert rig.s.state == CHECKING
        rig.block(NO_COMMAND)
    rig.block(NO_COMMAND)
    assert (rig.s.state, rig.s.cause, rig.s.verified) == (ARMED, FIRST_CHECK, 1)
    assert rig.s.vibration_mps < 1e-6  # the tones of the check do not count as vibration after it
    assert rig.s.amplitude_m == 0.0
    assert rig.s.gain[:5] == pytest.approx([0.7] * 5, rel=0.03)
    assert rig.p.tone_Hz[:5] == pytest.approx([1250.0, 2000.0, 2750.0, 3500.0, 4250.0])


def after_a_check(rig: Rig, gain: float, word: int = ARM) -> tuple[int, int]:
    """State and cause after a check at another gain."""
    rig.gain = gain
    assert apply_order(rig.s, word)
    for _ in range(BLOCKS + 20):
        rig.block(NO_COMMAND)
    return int(rig.s.state), int(rig.s.cause)


@pytest.mark.slow
def test_a_check_that_finds_a_changed_gain_asks_the_operator() -> None:
    rig = Rig(arm=False)
    assert after_a_check(rig, 1.0) == (ARMED, FIRST_CHECK)
    for gain in (1.1, 1.2, 0.85):  # each is compared with the accepted gain, so small changes do not add up
        apply_order(rig.s, DISARM)
        assert after_a_check(rig, gain) == (ARMED, CHECK_PASSED)
    assert rig.s.accepted[:5] == pytest.approx([1.0] * 5, rel=0.03)
    apply_order(rig.s, DISARM)
    assert after_a_check(rig, 0.5) == (READY, GAIN_CHANGED)
    assert gain_change(rig.p, rig.s) == pytest.approx(2.0, rel=0.05)
    assert after_a_check(rig, 0.5) == (READY, GAIN_CHANGED)  # the word ARM checks again
    rig.block(NO_COMMAND)
    assert rig.s.amplitude_m == 0.0
    assert apply_order(rig.s, ACCEPT_GAIN)
    assert (rig.s.state, rig.s.cause) == (ARMED, GAIN_ACCEPTED)
    apply_order(rig.s, DISARM)
    assert after_a_check(rig, 1.0, ACCEPT_GAIN) == (READY, GAIN_CHANGED)  # which begins a check, too
    assert after_a_check(rig, 0.5) == (ARMED, CHECK_PASSED)


def test_tones_keep_out_of_forbidden_bands() -> None:
    rig = Rig(GuardConfig(forbidden_Hz=[(3400.0, 4300.0)]))
    assert list(rig.p.tone_Hz[: rig.p.tones]) == [1250.0, 2000.0, 2750.0]


NOISY = ["drive_force_N", "mass_accel_mps2", "base_accel_mps2"]
PLACES = ["mass_position_m", "drive_position_m"]


def after_the_quiet_time(broken: str, channel: str) -> tuple[int, int]:
    rig = Rig(arm=False)
    getattr(rig, broken).add(channel)
    apply_order(rig.s, ARM)
    for _ in range(QUIET + 1):
        rig.block(NO_COMMAND)
    return int(rig.s.state), int(rig.s.cause)


@pytest.mark.parametrize("channel", NOISY)
def test_a_frozen_channel_fails_the_check(channel: str) -> None:
    assert after_the_quiet_time("frozen", channel) == (FAULT, SENSOR_FROZEN)


@pytest.mark.parametrize("channel", PLACES)
def test_a_frozen_encoder_without_noise_passes_the_check(channel: str) -> None:
    assert after_the_quiet_time("frozen", channel)[0] == CHECKING


@pytest.mark.parametrize("channel", [*NOISY, *PLACES])
def test_a_channel_of_nan_fails_the_check(channel: str) -> None:
    assert after_the_quiet_time("nan", channel) == (FAULT, SENSOR_NOT_FINITE)


def test_an_exciter_that_is_silent_fails_the_check() -> None:
    rig = Rig(arm=False)
    rig.gain = 0.0
    apply_order(rig.s, ARM)
    for _ in range(QUIET + 300):
        rig.block(NO_COMMAND)
    assert (rig.s.state, rig.s.cause, rig.s.verified) == (FAULT, EXCITER_SILENT, 0)
    for _ in range(20):
        rig.block(NO_COMMAND)
    assert (rig.s.amplitude_m, rig.s.enable) == (0.0, 0)


def test_a_dead_enable_line_fails_the_check() -> None:
    rig = Rig(arm=False)
    rig.always_on = True
    apply_order(rig.s, ARM)
    for _ in range(QUIET + 1):
        rig.block(NO_COMMAND)
    assert (rig.s.state, rig.s.cause) == (FAULT, ENABLE_DEAD)


@pytest.mark.parametrize(
    ("gain", "given", "after"),
    [
        (0.102, 1.0, (READY, GAIN_UNEXPECTED)),  # an accelerometer in g
        (0.6, 1.0, (READY, GAIN_UNEXPECTED)),
        (1.7, 1.0, (READY, GAIN_UNEXPECTED)),
        (0.72, 1.0, (ARMED, FIRST_CHECK)),
        (1.4, 1.0, (ARMED, FIRST_CHECK)),
        (3.0, 2.5, (ARMED, FIRST_CHECK)),
        (1.0, 2.5, (READY, GAIN_UNEXPECTED)),
    ],
)
def test_the_first_check_compares_the_gain_with_the_rig_file(gain: float, given: float, after: tuple[int, int]) -> None:
    rig = Rig(GuardConfig(exciter_gain=given), arm=False)
    assert after_a_check(rig, gain) == after
    if after[0] == READY:
        assert rig.s.accepted[0] == 0.0
        assert gain_report(rig.p, rig.s).startswith(f"measured {rig.s.gain[0]:.3g} at 1250 Hz (expected {given:g}), ")
        assert apply_order(rig.s, ACCEPT_GAIN)
        assert (rig.s.state, rig.s.cause) == (ARMED, GAIN_ACCEPTED)


def test_an_exciter_of_another_gain_at_the_last_tone_alone_is_not_verified() -> None:
    rig = Rig(arm=False)
    apply_order(rig.s, ARM)
    for block in range(BLOCKS + 20):
        rig.gain = 1.0 if block < BLOCKS - 200 else 2.0
        rig.block(NO_COMMAND)
    assert (rig.s.state, rig.s.cause) == (READY, GAIN_UNEXPECTED)
    assert gain_change(rig.p, rig.s) == pytest.approx(2.0, rel=0.05)


def test_the_tones_keep_the_absolute_limits() -> None:
    """A gain of 10 at the full stroke is v_a far above the limit, at a drive at rest."""
    slow = Level(alarm=2e-4, abort=3e-4)
    rig = Rig(GuardConfig(check_share=1.0, velocity_mps=slow), arm=False)
    rig.v_d_mps, rig.gain = 0.0, 10.0
    apply_order(rig.s, ARM)
    for _ in range(BLOCKS):
        rig.block(NO_COMMAND)
        assert rig.s.amplitude_m * 2.0 * math.pi * rig.s.frequency_Hz < 1.6e-4
    assert (rig.s.state, rig.s.cause) == (FAULT, DRIVE_MAX)


def test_a_tone_without_amplitude_is_silent() -> None:
    rig = Rig(arm=False)
    rig.p.alarm[OVERTRAVEL - FIRST] = 0.0
    apply_order(rig.s, ARM)
    for _ in range(QUIET + 200):
        rig.block(NO_COMMAND)
    assert (rig.s.state, rig.s.cause) == (FAULT, EXCITER_SILENT)


def test_a_channel_may_freeze_for_part_of_the_quiet_time() -> None:
    """A converter of few bits shows the same number for a while."""
    rig = Rig(arm=False)
    apply_order(rig.s, ARM)
    for block in range(QUIET + 2):
        rig.frozen = {"drive_force_N"} if block < 400 else set()
        rig.block(NO_COMMAND)
    assert rig.s.state == CHECKING


def test_the_gain_is_measured_in_the_second_half_of_a_tone() -> None:
    """In the first half the exciter starts, and the base swings in."""
    rig = Rig(arm=False)
    block: Any = sensor_block(20).blank()[0]
    rig.s.amplitude_m = 10 * NANO
    for block_at in range(BLOCKS):
        block.drive_force_N[:] = block.mass_accel_mps2[:] = block.base_accel_mps2[:] = block_at
        block.mass_position_m[:] = block.drive_position_m[:] = block_at
        in_tone = (block_at - QUIET) % 200
        follow_check(rig.p, rig.s, block, 4.0 if block_at >= QUIET and in_tone >= 100 else 1e-6)
    omega = 2.0 * math.pi * rig.p.tone_Hz[:5]
    assert rig.s.gain[:5] * omega**2 * 10 * NANO == pytest.approx([2.0] * 5)


def test_a_rig_that_is_armed_without_a_controller_is_disarmed_again() -> None:
    rig = Rig(arm=False)
    apply_order(rig.s, ARM)
    for _ in range(BLOCKS + 10):
        rig.block(NO_COMMAND)
    assert rig.s.state == ARMED
    for _ in range(750):
        rig.block(NO_COMMAND)
    assert rig.s.state == ARMED
    rig.block(NO_COMMAND)
    assert (rig.s.state, rig.s.cause) == (DISARMED, COMMAND_LOST)
