"""The guard: which commands it accepts, and how the vibration fades when commands stop."""

import math

import pytest

from bridge.guard.check import write_gain
from bridge.guard.config import GuardConfig
from bridge.guard.core import NO_COMMAND, write_in_force
from bridge.wire.messages import sensor_block
from bridge.wire.stickslip_pb2 import (
    ACTIVE,
    ARMED,
    ARMED_BY_SCENARIO,
    COMMAND_LOST,
    DISARMED,
    NO_CAUSE,
    SLEW_RATE,
    VIBRATION_BEGAN,
    VIBRATION_ENDED,
)
from tests.unit.bridge.guard.rigs import NANO, RUN, Rig


def test_a_rig_powers_up_disarmed_and_lets_nothing_vibrate() -> None:
    rig = Rig(arm=False)
    rig.run(100)
    assert (rig.s.state, rig.s.amplitude_m) == (DISARMED, 0.0)


def test_a_vibration_begins_and_ends_at_the_slew_and_the_state_follows() -> None:
    rig = Rig()
    assert (rig.s.state, rig.s.cause) == (ARMED, ARMED_BY_SCENARIO)
    rig.run(1)
    assert (rig.s.state, rig.s.cause, rig.s.limit) == (ACTIVE, VIBRATION_BEGAN, SLEW_RATE)
    assert rig.s.amplitude_m == pytest.approx(1 * NANO)
    assert rig.s.frequency_Hz == 2600.0
    rig.run(29)
    assert rig.s.amplitude_m == pytest.approx(30 * NANO)
    rig.run(1)
    assert rig.s.limit == NO_CAUSE
    rig.run(29, frequency_Hz=3000.0, amplitude_m=0.0)
    assert (rig.s.state, rig.s.frequency_Hz) == (ACTIVE, 2600.0)
    rig.run(2, amplitude_m=0.0)
    assert (rig.s.state, rig.s.cause, rig.s.amplitude_m) == (ARMED, VIBRATION_ENDED, 0.0)


def test_the_watchdog_counter_toggles_and_the_exciter_is_enabled_only_where_it_may_vibrate() -> None:
    rig = Rig()
    rig.run(30)
    assert rig.s.enable == 1
    toggles: list[int] = []
    rig.s.state = DISARMED
    for _ in range(31):
        rig.run(1)
        toggles.append(int(rig.s.toggle))
        assert rig.s.enable == (rig.s.amplitude_m > 0.0)  # on until the vibration has faded
    assert rig.s.enable == 0
    assert toggles == [1, 0] * 15 + [1]


def test_only_commands_of_this_run_count_that_are_newer_and_answer_a_block_that_was_sent() -> None:
    rig = Rig()
    rig.run(10)
    assert rig.command()
    assert not rig.command(run=RUN + 1)
    assert not rig.command(run=0)
    assert not rig.command(sequence=0)
    assert not rig.command(block=10)
    assert not rig.command(block=2**64 - 1)
    assert not rig.command(block=2**62)
    assert rig.command(block=0)
    assert rig.command(amplitude_m=0.0)
    assert not rig.command(sequence=int(rig.s.last_sequence))
    for past_the_end in (2**62, 2**63, 2**63 + 5, 2**64 - 1):  # as a signed number it would be below 0
        rig.s.fresh = 0
        assert not rig.command(sequence=past_the_end)
        rig.s.fresh = 1
        assert not rig.command(sequence=past_the_end)
    assert rig.s.refused == 15


@pytest.mark.parametrize(
    ("name", "value"),
    [("amplitude_m", math.nan), ("amplitude_m", math.inf), ("amplitude_m", -1.0), ("frequency_Hz", math.nan)],
)
def test_a_command_of_a_negative_or_not_finite_value_is_refused(name: str, value: float) -> None:
    rig = Rig()
    rig.run(10)
    assert not rig.command(**{name: value})
    assert rig.s.refused == 1


def test_a_restarted_controller_is_accepted_once_the_old_one_is_silent() -> None:
    rig = Rig()
    rig.run(10)
    assert rig.command(sequence=1000)
    assert not rig.command(sequence=0)
    for _ in range(60):
        rig.block(9)
    assert rig.s.fresh == 0
    assert rig.command(sequence=0)


def test_without_fresh_commands_it_fades_and_comes_back_but_not_after_three_quarters_of_a_second() -> None:
    rig = Rig()
    rig.run(100)
    for _ in range(50):
        rig.block(99)  # the command that answers block 99 acts from block 100 on: 50 blocks old at the last of these
    assert rig.s.limit == NO_CAUSE
    rig.block(99)
    assert (rig.s.fresh, rig.s.limit) == (0, COMMAND_LOST)
    for _ in range(30):
        rig.block(99)
    assert (rig.s.state, rig.s.amplitude_m) == (ARMED, 0.0)
    rig.run(30)
    assert rig.s.amplitude_m == pytest.approx(30 * NANO)
    last = int(rig.s.block) - 1
    for _ in range(50 + 750):
        rig.block(last)
    assert rig.s.state == ARMED
    rig.block(last)
    assert (rig.s.state, rig.s.cause) == (DISARMED, COMMAND_LOST)
    rig.run(100)
    assert (rig.s.state, rig.s.amplitude_m) == (DISARMED, 0.0)


def test_a_rig_that_waits_for_its_first_controller_stays_armed() -> None:
    rig = Rig()
    for _ in range(2000):
        rig.block(NO_COMMAND)
    assert (rig.s.state, rig.s.limit) == (ARMED, NO_CAUSE)


def test_an_exciter_without_a_slew_follows_at_once() -> None:
    from tests.unit.bridge.guard.rigs import EXCITER

    rig = Rig(GuardConfig(), exciter=EXCITER._replace(slew_m_per_s=0.0))
    rig.run(1)
    assert rig.s.amplitude_m == pytest.approx(30 * NANO)


def test_after_a_check_each_block_publishes_one_of_its_gains() -> None:
    rig = Rig(GuardConfig(check_Hz=[1000.0, 2000.0, 4000.0]))
    rig.s.gain[:3] = 1.0, 2.0, 6.0
    block = sensor_block(20).blank()
    write_gain(rig.p, rig.s, block[0])
    assert (block[0]["check_Hz"], block[0]["check_gain"]) == (0.0, 0.0)
    rig.s.verified = 1
    published = []
    for rig.s.block in range(3):
        write_gain(rig.p, rig.s, block[0])
        published.append((float(block[0]["check_Hz"]), float(block[0]["check_gain"])))
    assert published == [(1000.0, 1.0), (2000.0, 2.0), (4000.0, 6.0)]


def test_each_block_states_the_vibration_in_force_and_the_limit_that_held_it() -> None:
    rig, block = Rig(), sensor_block(20).blank()
    names = "applied_Hz", "applied_m", "applied_block", "fallback", "guard_limit"
    write_in_force(rig.s, NO_COMMAND, block[0])
    assert block[0]["applied_block"] == 2**64 - 1
    rig.run(2)
    write_in_force(rig.s, 1, block[0])
    assert [float(block[0][name]) for name in names] == pytest.approx([2600.0, 2 * NANO, 1, 0, SLEW_RATE])
    for _ in range(60):
        rig.block(1)
    write_in_force(rig.s, 1, block[0])
    assert (block[0]["fallback"], block[0]["guard_limit"]) == (1, COMMAND_LOST)
