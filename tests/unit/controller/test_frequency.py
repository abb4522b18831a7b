"""The cheapest frequency: little stroke at high ones, little of the accelerometer's range at low ones."""

import math
from typing import Any

import pytest

from bridge.config import validate
from controller.config import ControllerConfig
from controller.policy.frequency import cheapest, cost
from controller.records import build


def _start(**amplitude: float) -> tuple[Any, Any]:
    params, state = build(validate(ControllerConfig, {"amplitude": amplitude}, "test"))
    return params[0], state[0]


def test_stroke_and_acceleration_count_as_shares() -> None:
    p, s = _start()
    frequency_Hz = p.candidate_Hz[3]
    omega = 2.0 * math.pi * frequency_Hz
    expected = (6e-4 / omega / p.amplitude_max_m) ** 2 + (omega * 6e-4 / p.accel_range_mps2) ** 2
    assert cost(p, s, 3, 6e-4) == pytest.approx(expected)


@pytest.mark.parametrize(("accel_range_mps2", "frequency_Hz"), [(490.0, 4500.0), (20.0, 2600.0)])
def test_the_range_of_the_accelerometer_pulls_the_frequency_down(accel_range_mps2: float, frequency_Hz: float) -> None:
    p, s = _start(accel_range_mps2=accel_range_mps2)
    assert p.candidate_Hz[cheapest(p, s, 6e-4, -1)] == frequency_Hz


def test_it_is_the_least_of_all_and_never_the_excluded_one() -> None:
    p, s = _start(accel_range_mps2=50.0)
    best = cheapest(p, s, 6e-4, -1)
    costs = [cost(p, s, i, 6e-4) for i in range(p.candidates)]
    assert costs[best] == min(costs)
    second = cheapest(p, s, 6e-4, best)
    assert costs[second] == sorted(costs)[1]


def test_a_weak_exciter_costs_and_a_resonance_gains_nothing() -> None:
    p, s = _start()
    plain = cost(p, s, 5, 6e-4)
    s.gain_known[5] = 1
    s.log_gain[5] = math.log(10.0)
    assert cost(p, s, 5, 6e-4) == plain
    s.log_gain[5] = math.log(0.1)
    assert cost(p, s, 5, 6e-4) > 50.0 * plain
