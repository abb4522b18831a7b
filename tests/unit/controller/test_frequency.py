"""The cheapest frequency: little stroke at high ones, little of the accelerometer's range at low ones."""

import math

import pytest

from bridge.config import validate
from controller.config import ControllerConfig, candidate_frequencies_Hz, cheapest_frequency_Hz


def _config(accel_range_mps2: float) -> ControllerConfig:
    return validate(ControllerConfig, {"amplitude": {"accel_range_mps2": accel_range_mps2}}, "test")


@pytest.mark.parametrize(("accel_range_mps2", "frequency_Hz"), [(490.0, 4500.0), (20.0, 2600.0)])
def test_the_range_of_the_accelerometer_pulls_the_frequency_down(accel_range_mps2: float, frequency_Hz: float) -> None:
    assert cheapest_frequency_Hz(_config(accel_range_mps2)) == frequency_Hz


def test_the_squared_shares_of_stroke_and_range_are_least() -> None:
    config = _config(50.0)
    # the sum of a square and of the square of its inverse is least where both are equal
    equal_Hz = math.sqrt(50.0 / 1e-7) / (2.0 * math.pi)
    nearest_Hz = min(candidate_frequencies_Hz(config), key=lambda frequency_Hz: abs(math.log(frequency_Hz / equal_Hz)))
    assert cheapest_frequency_Hz(config) == nearest_Hz
