"""The end of trips: the memory of force and motion is as at a start, and the memory of the exciter stays."""

import numpy as np
import pytest

from bridge.wire.messages import RESET
from controller.config import ControllerConfig
from controller.records import STATE, build
from controller.trips.doubts import ACCELEROMETER, DRIVE
from controller.trips.reset import end_trips

MOTION = {"bins", "sigma", "differences", "drive_velocity_mps", "shown", "breakaway_N", "mode"}
ANY_RESET = {"trip", "doubted", "kept_mps", "evidence_s", "repeats", "gain_off_s", "needless_from_mps", "off_left_s"}
KEPT = {"slips", "surges", "gain", "known_gain", "loop_delay_steps", "in_force_s", "steps", "block", "phase_rad"}


@pytest.mark.parametrize(("doubted", "forgets_motion"), [(DRIVE, True), (ACCELEROMETER, False)])
def test_a_reset_forgets_only_values_of_the_doubted_channels(doubted: int, forgets_motion: bool) -> None:
    params, memory = build(ControllerConfig())
    memory.view(np.int64)[:] = 1
    memory["doubted"] = doubted
    end_trips(params[0], memory[0], memory, RESET)
    zero = {name for name in STATE.names or () if not memory[0][name].any()}
    assert zero >= ANY_RESET
    assert not KEPT & zero
    assert (zero >= MOTION) if forgets_motion else not MOTION & zero
