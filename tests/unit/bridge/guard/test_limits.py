"""Every limit holds at its alarm level, and trips where its abort level is passed for longer than its time."""

import math

import pytest

from bridge.guard.config import GuardConfig, HeatConfig, Level
from bridge.guard.estimates import expect_drive
from bridge.guard.limits import exciter_gain, nearest_allowed_Hz, passes, watch
from bridge.guard.records import FIRST
from bridge.guard.states import ARM, apply_order
from bridge.wire.stickslip_pb2 import (
    ACTIVE,
    ARMED,
    BAND,
    DISARMED,
    DRIVE_FAST,
    DRIVE_MAX,
    DRIVE_RATIO,
    DUTY,
    FAULT,
    HEAT,
    LOUD,
    NO_CAUSE,
    OVERTRAVEL,
)
from tests.unit.bridge.guard.rigs import EXCITER, NANO, Rig

TWO_PI = 2.0 * math.pi
FREE = Level(alarm=1e9, abort=1e9)


def settled(rig: Rig, amplitude_m: float, frequency_Hz: float = 2600.0) -> None:
    rig.run(110, frequency_Hz, amplitude_m)


def test_the_stroke_is_held_at_its_alarm_and_trips_beyond_its_abort() -> None:
    rig = Rig(GuardConfig(loud_ratio=FREE))
    settled(rig, 149 * NANO)
    assert (rig.s.state, rig.s.limit) == (ACTIVE, OVERTRAVEL)
    assert rig.s.amplitude_m == pytest.approx(100 * NANO)
    rig.run(200, amplitude_m=151 * NANO)
    assert rig.s.state == ACTIVE
    rig.run(1, amplitude_m=151 * NANO)
    assert (rig.s.state, rig.s.cause) == (FAULT, OVERTRAVEL)
    rig.run(100, amplitude_m=30 * NANO)
    assert (rig.s.state, rig.s.amplitude_m) == (FAULT, 0.0)


@pytest.mark.parametrize(("above", "within", "trips"), [(1, 1, True), (1, 3, True), (1, 5, False), (20, 200, False)])
def test_a_level_exceeded_for_more_than_a_fifth_of_the_time_trips(above: int, within: int, trips: bool) -> None:
    """Two senders in turn cannot reset the time above the level."""
    level = Level(alarm=50 * NANO, abort=80 * NANO, hold_s=0.05)
    rig = Rig(GuardConfig(loud_ratio=FREE, stroke_m=level))
    for _ in range(1500 // (above + within)):
        rig.run(above, amplitude_m=100 * NANO)
        rig.run(within, amplitude_m=20 * NANO)
    assert bool(rig.s.state == FAULT) is trips


def test_a_value_at_its_level_keeps_to_it() -> None:
    rig = Rig(GuardConfig(stroke_m=Level(alarm=50 * NANO, abort=80 * NANO, hold_s=0.0)))
    assert passes(rig.p, rig.s, OVERTRAVEL, 50 * NANO)
    assert rig.s.limit == NO_CAUSE
    assert not passes(rig.p, rig.s, OVERTRAVEL, 80 * NANO)
    assert (rig.s.state, rig.s.limit) == (ARMED, OVERTRAVEL)
    passes(rig.p, rig.s, OVERTRAVEL, 80.1 * NANO)
    assert (rig.s.state, rig.s.cause) == (FAULT, OVERTRAVEL)


def test_the_commanded_velocity_is_held() -> None:
    level = Level(alarm=6e-4, abort=7e-4)
    rig = Rig(GuardConfig(loud_ratio=FREE, velocity_mps=level))
    settled(rig, 6.5e-4 / (TWO_PI * 2600.0))
    assert (rig.s.state, rig.s.limit) == (ACTIVE, DRIVE_MAX)
    assert TWO_PI * 2600.0 * rig.s.amplitude_m == pytest.approx(6e-4)
    rig.run(300, amplitude_m=7.5e-4 / (TWO_PI * 2600.0))
    assert (rig.s.state, rig.s.cause) == (FAULT, DRIVE_MAX)


def test_a_measured_velocity_above_the_absolute_limit_trips_whatever_the_encoder_shows() -> None:
    rig = Rig(GuardConfig(velocity_mps=Level(alarm=1.5e-3, abort=2e-3)))
    rig.gain, rig.v_d_mps, rig.drive_scale, rig.slide_mps = 5.0, 4e-4, 2.5, 1e-3
    rig.run(350)
    assert (rig.s.state, rig.s.cause) == (FAULT, DRIVE_MAX)


@pytest.mark.parametrize(("scale", "state"), [(1.0, ACTIVE), (2.9, ACTIVE), (3.2, FAULT), (-3.2, FAULT)])
def test_a_drive_faster_than_its_fastest_trips(scale: float, state: int) -> None:
    rig = Rig()
    rig.drive_scale = scale  # of a drive of 0.5 mm/s, with a fastest of 1 mm/s
    rig.slide_mps = 5e-4 * abs(scale)
    rig.run(500)
    assert rig.s.state == ACTIVE  # the first velocities are noisy
    rig.run(202)
    assert rig.s.state == state
    if state == FAULT:
        assert rig.s.cause == DRIVE_FAST


@pytest.mark.parametrize(
    ("scale", "slide_mps", "agreed"),
    [
        (1.0, 5e-4, 1.0),
        (2.0, 5e-4, 1.25),  # an encoder with twice its scale, on a slide that slides
        (2.0, 2e-5, 2.0),  # on a slide that sticks nothing else shows v_d
        (1.0, 5e-3, 1.0),  # a slip
    ],
)
def test_the_velocity_of_the_drive_must_agree_with_the_slide(scale: float, slide_mps: float, agreed: float) -> None:
    rig = Rig(GuardConfig(loud_ratio=FREE))
    rig.drive_scale, rig.slide_mps = scale, slide_mps
    rig.run(700)
    assert rig.s.drive_mps == pytest.approx(agreed * 5e-4, rel=0.05)


def test_the_velocity_of_the_drive_must_agree_with_its_announcements() -> None:
    """Also where drive and slide have the same wrong unit."""
    rig = Rig(GuardConfig(loud_ratio=FREE))
    rig.drive_scale, rig.slide_mps = 2.0, 1e-3
    expect_drive(rig.s, 5e-4)
    rig.run(700)
    assert rig.s.drive_mps == pytest.approx(1.25 * 5e-4, rel=0.05)
    expect_drive(rig.s, 1e-3)
    rig.run(100)
    assert rig.s.drive_mps == pytest.approx(1e-3, rel=0.05)
    expect_drive(rig.s, 0.0)  # ahead of the drive, which still moves
    rig.run(200)
    assert rig.s.drive_mps == pytest.approx(1e-3, rel=0.05)


@pytest.mark.parametrize(
    ("scale", "slide", "noise_m"), [(2.0, 1.0, 0.0), (2.0, 2.0, 0.0), (10.0, 10.0, 0.0), (1.0, 1.0, 5e-5)]
)
def test_a_wrong_encoder_does_not_open_the_limits(scale: float, slide: float, noise_m: float) -> None:
    """100 nm at 4500 Hz are 2.8 mm/s: 5.7 v_d."""
    rig = Rig(GuardConfig(fastest_drive_mps=5e-4, velocity_mps=Level(alarm=1.5e-3, abort=2e-3)))
    rig.s.verified, rig.s.gain[:] = 1, 1.0
    rig.drive_scale, rig.slide_mps = scale, slide * 5e-4
    rig.noise["drive_position_m"] = noise_m
    for _ in range(600):
        rig.run(1, 4500.0, 100 * NANO)
        assert TWO_PI * 4500.0 * rig.s.amplitude_m < 1.6e-3
    assert rig.s.state == FAULT


def test_without_a_velocity_level_the_stroke_alone_bounds_the_velocity() -> None:
    rig = Rig(GuardConfig(loud_ratio=FREE))
    settled(rig, 1e-7, 5000.0)
    assert (rig.s.limit, rig.s.amplitude_m) == (NO_CAUSE, pytest.approx(100 * NANO))


@pytest.mark.parametrize(
    ("measured", "given", "gain"), [(1.0, 1.0, 1.0), (2.0, 1.0, 2.0), (0.1, 1.0, 1.0), (0.1, 0.5, 0.5)]
)
@pytest.mark.slow
def test_a_checked_gain_bounds_the_ratio_of_vibration_to_drive_velocity(
    measured: float, given: float, gain: float
) -> None:
    """A measured gain below the gain of the rig file does not raise the limit."""
    rig = Rig(GuardConfig(loud_ratio=FREE, exciter_gain=given))
    rig.s.verified, rig.s.gain[:] = 1, measured
    rig.v_d_mps = 2.5e-4
    amplitude_m = 3.5 * 2.5e-4 / (TWO_PI * 4000.0) / gain
    settled(rig, amplitude_m, 4000.0)
    assert (rig.s.state, rig.s.limit) == (ACTIVE, DRIVE_RATIO)
    assert gain * TWO_PI * 4000.0 * rig.s.amplitude_m == pytest.approx(3.0 * 2.5e-4, rel=0.02)
    assert rig.s.ratio_blocks > rig.p.window_blocks
    rig.command(4000.0, 0.0)
    rig.block(int(rig.s.block) - 1, 4000.0, 0.0)
    rig.command(4000.0, amplitude_m)
    rig.block(int(rig.s.block) - 1, 4000.0, amplitude_m)
    assert rig.s.limit != DRIVE_RATIO  # the limit holds without a report until the drive is seen to start
    rig.v_d_mps = 1.75e-4  # the ratio of the same command is 5 when the old velocity is forgotten
    rig.run(1500, 4000.0, amplitude_m)
    assert (rig.s.state, rig.s.cause) == (FAULT, DRIVE_RATIO)


def test_the_gain_between_tones_lies_on_a_straight_line() -> None:
    rig = Rig(GuardConfig(check_Hz=[1000.0, 2000.0, 4000.0]))
    rig.s.gain[:3] = 1.0, 2.0, 6.0
    gains = [exciter_gain(rig.p, rig.s, hertz) for hertz in (500.0, 1000.0, 1500.0, 2000.0, 3000.0, 4000.0, 5000.0)]
    assert gains == pytest.approx([1.0, 1.0, 1.5, 2.0, 4.0, 6.0, 6.0])


def test_a_resonating_mount_trips_by_the_measured_velocity() -> None:
    rig = Rig()
    rig.gain = 5.0
    rig.run(90)
    assert rig.s.vibration_mps == pytest.approx(5.0 * TWO_PI * 2600.0 * 30 * NANO, rel=0.1)
    rig.run(150)
    assert (rig.s.state, rig.s.cause) == (FAULT, LOUD)


def test_a_vibration_at_a_resting_drive_is_loud() -> None:
    rig = Rig()
    rig.v_d_mps = 0.0
    rig.run(150)
    assert (rig.s.state, rig.s.cause) == (FAULT, LOUD)


@pytest.mark.parametrize("frequency_Hz", [499.0, 5001.0, 4600.0, 4700.0, 4800.0])
def test_nothing_is_vibrated_outside_of_the_bands(frequency_Hz: float) -> None:
    rig = Rig(GuardConfig(forbidden_Hz=[(4600.0, 4800.0)]))
    rig.run(200, frequency_Hz)
    assert (rig.s.state, rig.s.limit, rig.s.amplitude_m) == (ARMED, BAND, 0.0)
    rig.run(1, frequency_Hz)
    assert (rig.s.state, rig.s.cause) == (FAULT, BAND)


@pytest.mark.parametrize("frequency_Hz", [500.0, 5000.0, 4599.0, 4801.0])
def test_the_edges_of_the_bands_are_allowed(frequency_Hz: float) -> None:
    rig = Rig(GuardConfig(forbidden_Hz=[(4600.0, 4800.0)], loud_ratio=FREE))
    rig.run(300, frequency_Hz)
    assert (rig.s.state, rig.s.limit) == (ACTIVE, NO_CAUSE)


@pytest.mark.parametrize(
    ("asked_Hz", "nearest_Hz"),
    [(100.0, 500.0), (3060.0, 3201.0), (3150.0, 3201.0), (4000.0, 4000.0), (4950.0, 4899.0), (9000.0, 4899.0)],
)
def test_a_frequency_moves_to_the_nearest_allowed_one(asked_Hz: float, nearest_Hz: float) -> None:
    """Upwards out of bands that overlap, downwards out of a band at the end of the range."""
    rig = Rig(GuardConfig(forbidden_Hz=[(3000.0, 3100.0), (3050.0, 3200.0), (4900.0, 5000.0)]))
    assert nearest_allowed_Hz(rig.p, asked_Hz) == nearest_Hz


@pytest.mark.slow
def test_warmth_follows_its_model_and_trips() -> None:
    heat = HeatConfig(time_s=0.1, rise_max_K=5e-3)
    rig = Rig(GuardConfig(heat=heat, loud_ratio=FREE))
    volts2_Hz = 2600.0 * (30 * NANO / heat.stroke_m_per_V) ** 2
    share = math.pi * heat.loss_tangent * heat.capacitance_F * volts2_Hz * heat.resistance_K_per_W / heat.rise_max_K
    rig.run(1000)
    assert rig.s.heat == pytest.approx(share, rel=0.01)
    assert share < heat.alarm_share
    warm = math.sqrt(0.9 / share)
    rig.run(1000, amplitude_m=30 * NANO * warm)
    assert (rig.s.state, rig.s.limit) == (ACTIVE, HEAT)
    rig.run(1000, amplitude_m=30 * NANO * math.sqrt(1.2 / share))
    assert (rig.s.state, rig.s.cause) == (FAULT, HEAT)


@pytest.mark.parametrize("state", [DISARMED, FAULT])
def test_an_exciter_cools_in_every_state_but_trips_only_where_it_may_vibrate(state: int) -> None:
    rig = Rig(GuardConfig(heat=HeatConfig(time_s=0.2)))
    rig.s.heat, rig.s.state = 2.0, state
    rig.run(200)
    assert (rig.s.state, rig.s.limit) == (state, NO_CAUSE)
    assert rig.s.heat == pytest.approx(2.0 * math.exp(-1.0), rel=0.01)


def test_a_hot_exciter_is_not_checked() -> None:
    rig = Rig(arm=False)
    rig.s.heat = 1.1
    apply_order(rig.s, ARM)
    rig.run(1)
    assert (rig.s.state, rig.s.cause) == (FAULT, HEAT)


def test_duty_is_the_share_of_the_time() -> None:
    level = Level(alarm=0.4, abort=0.6, hold_s=0.0)
    rig = Rig(GuardConfig(duty=level, duty_window_s=0.5, loud_ratio=FREE))
    rig.run(300)
    assert (rig.s.state, rig.s.limit, rig.s.duty) == (ACTIVE, DUTY, pytest.approx(1.0 - math.exp(-0.6), abs=0.01))
    rig.run(200)
    assert (rig.s.state, rig.s.cause) == (FAULT, DUTY)


def test_an_exciter_that_rests_counts_as_no_duty() -> None:
    rig = Rig(GuardConfig(duty_window_s=0.5, loud_ratio=FREE))
    rig.run(300)
    before = float(rig.s.duty)
    rig.run(500 + 30, amplitude_m=0.0)  # one time constant, after a ramp of 30 blocks
    assert rig.s.duty == pytest.approx(before * math.exp(-1.0), rel=0.1)


def test_a_machine_that_shakes_while_the_exciter_rests_is_not_loud() -> None:
    rig = Rig()
    for _ in range(300):
        rig.s.vibration_mps = 1.0
        rig.run(1, amplitude_m=0.0)
    assert (rig.s.state, rig.s.limit) == (ARMED, NO_CAUSE)


def test_by_default_no_duty_is_too_much() -> None:
    rig = Rig(GuardConfig(duty_window_s=0.01, loud_ratio=FREE))
    rig.run(1000)
    assert (rig.s.state, rig.s.limit) == (ACTIVE, NO_CAUSE)


def test_a_vibration_within_its_ratio_is_not_held() -> None:
    rig = Rig(GuardConfig(loud_ratio=FREE))
    rig.s.verified, rig.s.gain[:] = 1, 1.0
    settled(rig, 30 * NANO)
    assert (rig.s.state, rig.s.limit, rig.s.amplitude_m) == (ACTIVE, NO_CAUSE, pytest.approx(30 * NANO))


def test_a_drive_position_of_nan_lets_the_velocity_expire() -> None:
    rig = Rig()
    rig.run(100)
    before_mps = float(rig.s.drive_mps)
    rig.nan.add("drive_position_m")
    rig.run(1)
    assert rig.s.drive_mps == before_mps  # a single such block changes nothing
    rig.nan.clear()
    rig.run(1)
    assert math.isfinite(rig.s.drive_mps)


def test_a_frequency_at_half_the_sample_rate_shows_no_amplitude() -> None:
    rig = Rig(exciter=EXCITER._replace(frequency_max_Hz=10_000.0))
    rig.run(50, frequency_Hz=10_000.0)
    assert rig.s.vibration_mps == 0.0


def test_a_velocity_that_the_drive_is_going_to_have_counts_before_it_moves() -> None:
    rig = Rig()
    rig.v_d_mps = 0.0
    for _ in range(100):
        expect_drive(rig.s, -5e-4)
        rig.run(1)
    assert rig.s.state == ACTIVE
    assert rig.s.drive_mps == pytest.approx(5e-4, rel=0.01)


def test_a_jump_of_the_drive_position_does_not_change_the_velocity() -> None:
    rig = Rig()
    rig.run(100)
    rig.v_d_mps = 1.0
    rig.run(1)  # 1 mm in a block
    rig.v_d_mps = 5e-4
    rig.run(60)
    assert rig.s.drive_mps == pytest.approx(5e-4, rel=0.05)


def test_a_short_shake_is_not_reported_as_loud() -> None:
    rig = Rig()
    rig.run(90)
    rig.gain = 6.0
    rig.run(10)
    assert (rig.s.state, rig.s.limit) == (ACTIVE, NO_CAUSE)
    rig.run(30)
    assert rig.s.limit == LOUD


def test_a_loud_vibration_is_reported_after_a_tenth_of_its_trip_time() -> None:
    rig = Rig()
    rig.run(90)
    tenth = int(rig.p.hold_blocks[LOUD - FIRST]) // 10
    limits: list[int] = []
    for _ in range(tenth + 1):
        rig.s.limit, rig.s.vibration_mps = NO_CAUSE, 1.0
        watch(rig.p, rig.s)
        limits.append(int(rig.s.limit))
    assert limits == [NO_CAUSE] * tenth + [LOUD]
