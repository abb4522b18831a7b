"""Channels that a rig does not have: it is armed without them, or refused, and the lost protection is reported."""

import numpy as np
import pytest

from bridge.config import validate
from bridge.faults import Fault
from bridge.guard.absent import absent, lost_protection
from bridge.guard.config import GuardConfig
from bridge.guard.states import ARM, apply_order
from bridge.guard.wide import protection
from bridge.wire.channels import CHANNELS
from bridge.wire.stickslip_pb2 import ARMED, FAULT, FIRST_CHECK, SENSOR_FROZEN
from plant.config import RigConfig
from tests.unit.bridge.guard.rigs import EXCITER, Rig, real

CHECK_BLOCKS = 200 + 500 + 5 * 200
REFUSED = ("base_accel_mps2", "drive_position_m")


def checked(rig: Rig) -> tuple[int, int]:
    apply_order(rig.s, ARM)
    rig.run(CHECK_BLOCKS)
    for _ in range(60):
        rig.block(0)
        if rig.s.state in (ARMED, FAULT):
            break
    return int(rig.s.state), int(rig.s.cause)


@pytest.mark.parametrize("name", [name for name in CHANNELS if name not in REFUSED])
def test_a_rig_without_a_channel_is_armed(name: str) -> None:
    """Zeros of a missing force or slide acceleration counted as a frozen sensor, so such a rig could not be armed."""
    rig = Rig(arm=False, absent=(name,))
    rig.nan = {name}  # an open input
    assert checked(rig) == (ARMED, FIRST_CHECK)
    assert np.array_equal(rig.row[name], np.zeros(20))
    assert rig.s.drive_mps == pytest.approx(5e-4, rel=0.02)


def test_a_present_channel_is_still_checked_beside_an_absent_one() -> None:
    rig = Rig(arm=False, absent=("drive_force_N",))
    rig.frozen = {"drive_force_N", "mass_accel_mps2"}
    assert checked(rig) == (FAULT, SENSOR_FROZEN)
    assert rig.s.frozen_channel == 1


@pytest.mark.parametrize("name", REFUSED)
def test_a_rig_without_a_needed_channel_is_refused_with_the_reason(name: str) -> None:
    with pytest.raises(
        Fault, match=rf"channels.{name}.absent = true: a rig needs this channel: no other channel shows "
    ):
        Rig(absent=("drive_force_N", name))


def test_the_lost_protection_is_reported_at_the_start() -> None:
    missing = ["mass_position_m", "drive_force_N"]
    assert [text.partition(":")[0] for text in lost_protection(missing)] == ["no drive_force_N", "no mass_position_m"]
    without, complete = (protection(real(GuardConfig()), EXCITER, 1e-3, names) for names in (missing, []))
    assert without == complete + [("UNPROTECTED", text) for text in lost_protection(missing)]


def test_a_rig_file_states_absent_channels_by_name() -> None:
    contact = {"pair": "C45-C45 @ 0.063"}
    table = {"contact": contact, "channels": {"drive_force_N": {"absent": True}, "mass_position_m": {}}}
    assert absent(validate(RigConfig, table, "rig.toml").channels) == ["drive_force_N"]
    with pytest.raises(Fault, match="drive_force: no such channel; known: drive_force_N"):
        validate(RigConfig, {"contact": contact, "channels": {"drive_force": {"absent": True}}}, "rig.toml")
