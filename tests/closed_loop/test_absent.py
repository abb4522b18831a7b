"""A rig without a channel is armed by its loop check, and slips no more."""

import numpy as np
import pytest

from bridge.guard.states import ARM
from bridge.wire.stickslip_pb2 import ACTIVE, CHECKING
from cockpit.run.closed_loop import ClosedLoop
from cockpit.run.scenario import load_scenario
from plant.records import TRUTH

# a slip of either rig is faster than this: 4 times its drive
FAST_MPS = 2e-3
VELOCITY = TRUTH.index("true_velocity_mps")


@pytest.mark.parametrize("scenario", ["ball-screw-axis", "paper-c45-c45"])
@pytest.mark.parametrize("channel", ["drive_force_N", "mass_accel_mps2", "mass_position_m"])
def test_a_rig_without_a_channel_is_armed_and_held(scenario: str, channel: str) -> None:
    settings = [f"rig.channels.{channel}.absent=true", "controller.policy.enabled_from_s=0.0", "duration_s=8.0"]
    stiffness = {"ball-screw-axis": 2e7, "paper-c45-c45": 11700.0}[scenario]
    made = load_scenario(scenario, [*settings, f"controller.drive_stiffness_N_per_m={stiffness}"])
    loop = ClosedLoop(made.rig, made.seed, made.controller, arm=False)
    loop.apply_order(ARM)
    run = loop.advance(8000)
    state = run.applied["guard_state"]
    assert state[0] == CHECKING
    assert state[-1] == ACTIVE
    assert np.array_equal(run.sensors[channel], np.zeros_like(run.sensors[channel]))
    armed = int(np.flatnonzero(state > CHECKING)[0])
    held = slice(armed + 2000, None)
    assert np.abs(run.truth[held, VELOCITY]).max() < FAST_MPS
    ratio = run.v_a_mps[held] / 5e-4
    assert (ratio > 1.02).mean() > 0.8  # the rest is a trial without vibration
    assert ratio.max() < 1.5
