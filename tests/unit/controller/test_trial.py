"""Trials without vibration: none is made with a force or slide position that is doubted."""

from typing import Any

from bridge.config import validate
from bridge.wire.stickslip_pb2 import PROBE
from controller.config import ControllerConfig
from controller.policy.trial import begin_trial, follow_trial, is_due
from controller.records import build
from controller.trips.doubts import CONTACT


def test_a_doubted_force_begins_no_trial_and_ends_a_running_one() -> None:
    params, memory = build(validate(ControllerConfig, {}, "test"))
    p: Any = params[0]
    s: Any = memory[0]
    s.direction, s.untried_s[0], s.steady_s, s.ratio_now = 1, 1000.0, 10.0, 1.2
    assert is_due(p, s, 5e-4)
    begin_trial(p, s, 10.0, 5e-4, 0)
    assert s.mode == PROBE
    assert not follow_trial(p, s, 10.0, 5e-4)
    s.doubted = CONTACT
    assert follow_trial(p, s, 10.0, 5e-4)
    assert not is_due(p, s, 5e-4)
