"""A rig without a channel is armed by its loop check, and slips no more."""

from pathlib import Path

import numpy as np
import pytest

from bridge.guard.states import ARM
from bridge.wire.stickslip_pb2 import ACTIVE, CHECKING
from cockpit.run.closed_loop import ClosedLoop
from cockpit.run.scenario import load_scenario
from plant.records import TRUTH
from tests.closed_loop.in_box import run_in_box
from tests.system.test_rig import rows
from tests.unit.bridge.rig.boxes import boxed, table

# a slip of either rig is faster than this: 4 times its drive
FAST_MPS = 2e-3
VELOCITY = TRUTH.index("true_velocity_mps")
STIFFNESS = {"ball-screw-axis": 2e7, "paper-c45-c45": 11700.0}
EXCITER = {"ball-screw-axis": {"amplitude_max_m": 1e-6, "amplitude_slew_m_per_s": 1e-5}, "paper-c45-c45": {}}


@pytest.mark.parametrize("scenario", ["ball-screw-axis", "paper-c45-c45"])
@pytest.mark.parametrize("channel", ["drive_force_N", "mass_accel_mps2", "mass_position_m"])
def test_a_rig_without_a_channel_is_armed_and_held(scenario: str, channel: str) -> None:
    settings = [f"rig.channels.{channel}.absent=true", "controller.policy.enabled_from_s=0.0", "duration_s=8.0"]
    made = load_scenario(scenario, [*settings, f"controller.drive_stiffness_N_per_m={STIFFNESS[scenario]}"])
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


@pytest.mark.nightly
@pytest.mark.slow
@pytest.mark.parametrize("rig", STIFFNESS)
@pytest.mark.parametrize("channel", ["drive_force_N", "mass_accel_mps2", "mass_position_m"])
def test_a_device_without_a_channel_is_armed_and_held(rig: str, channel: str, tmp_path: Path) -> None:
    """By the record of a device in another process."""
    record = tmp_path / "truth.csv"
    channels = table()["channels"] | {channel: {"absent": True}}
    with boxed(tmp_path, rig=rig, record=str(record)) as port:
        device = {"address": f"127.0.0.1:{port}", "waits": True}
        tables = table(device=device, channels=channels, exciter=EXCITER[rig] | {"enable_line": True})
        controller = {"drive_stiffness_N_per_m": STIFFNESS[rig], "policy": {"enabled_from_s": 0.0}}
        made = run_in_box(tmp_path, tables, 6.0, **controller)
    assert made.states[-1] == ACTIVE
    held = np.array(rows(record))[made.armed + 2000 : len(made.states)]
    assert np.abs(held[:, 3]).max() < FAST_MPS
    ratio = held[:, 1] / held[:, 2]
    assert np.mean((ratio > 1.02) & (ratio < 1.5)) > 0.99
