"""The demodulated v_a against the vibration that was put in."""

import math
from typing import Any

import numpy as np
import pytest

from bridge.config import validate
from controller.config import ControllerConfig
from controller.records import build
from controller.vibration import measure


def _measured(frequency_Hz: float, velocity_mps: float, offset: float, blocks: int = 60) -> tuple[Any, Any, Any]:
    params, state = build(validate(ControllerConfig, {}, "test"))
    p, s = params[0], state[0]
    s.allowed_Hz = frequency_Hz
    s.allowed_m = 1e-8
    omega = 2 * math.pi * frequency_Hz
    t_s = np.arange(blocks * 20) / 20000.0
    rolled_off = 1 / math.sqrt(1 + (frequency_Hz / 10000.0) ** 2)
    accel = (velocity_mps * omega * rolled_off * np.cos(omega * t_s + offset)).astype(np.float32)
    for block in range(blocks):
        samples = accel[20 * block : 20 * block + 20]
        measure(p, s, samples)
    return p, s, samples


@pytest.mark.parametrize("frequency_Hz", [500.0, 1144.0, 2600.0, 3333.0, 5000.0])
@pytest.mark.parametrize("offset", [0.0, 2.0])
def test_amplitude_is_found_at_any_phase(frequency_Hz: float, offset: float) -> None:
    _, s, _ = _measured(frequency_Hz, 6e-4, offset)
    assert s.vibration_velocity_mps == pytest.approx(6e-4, rel=1e-3)
