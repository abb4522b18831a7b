"""No input, however wrong, gets past the limits."""

import math
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from bridge.config import validate
from bridge.faults import Fault
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import BLOCK, RESET, STALE, STOP
from controller.config import ControllerConfig
from controller.limits import allow
from controller.records import build

CONFIG = validate(ControllerConfig, {"limits": {"forbidden_Hz": [(2000.0, 2300.0), (4600.0, 5000.0)]}}, "test")
ANYTHING = st.floats(allow_nan=True, allow_infinity=True)
EVENTS = st.sampled_from([BLOCK, STALE, BLOCK | STOP, BLOCK | RESET, STALE | STOP])


def _start() -> tuple[Any, Any]:
    params, state = build(CONFIG)
    return params[0], state[0]


@given(st.lists(st.tuples(EVENTS, ANYTHING, ANYTHING), min_size=1, max_size=60))
@pytest.mark.slow
def test_every_command_is_inside_the_limits(wants: list[tuple[int, float, float]]) -> None:
    p, s = _start()
    last_m = 0.0
    for events, wanted_Hz, wanted_m in wants:
        allow(p, s, events, wanted_Hz, wanted_m)
        assert 0.0 <= s.allowed_m <= CONFIG.limits.amplitude_max_m
        # a lower frequency allows more, so only the range may take more than a slew's step away
        assert s.allowed_m - last_m <= p.slew_m_per_step * (1 + 1e-12)
        if s.allowed_m > 0.0:
            assert 500.0 <= s.allowed_Hz <= 5000.0
            assert not any(low <= s.allowed_Hz <= high for low, high in CONFIG.limits.forbidden_Hz)
            assert 2 * math.pi * s.allowed_Hz * s.allowed_m <= CONFIG.limits.velocity_max_mps * (1 + 1e-9)
        last_m = s.allowed_m


BANDS = st.lists(
    st.tuples(st.floats(400.0, 5100.0), st.floats(0.5, 2000.0)).map(lambda band: (band[0], band[0] + band[1])),
    min_size=1,
    max_size=8,
)


@given(BANDS, st.floats(400.0, 5100.0))
@example([(4600.0, 5000.0), (4500.0, 4700.0)], 4800.0)
@example([(4600.0, 5000.0), (4000.0, 4599.5)], 4800.0)
@example([(500.0, 4999.5)], 600.0)
def test_no_frequency_is_inside_a_forbidden_band_however_the_bands_lie(
    bands: list[tuple[float, float]], wanted_Hz: float
) -> None:
    try:
        config = validate(ControllerConfig, {"contact_resonance_Hz": 0.0, "limits": {"forbidden_Hz": bands}}, "test")
    except Fault:  # nothing is left
        return
    params, state = build(config)
    allow(params[0], state[0], BLOCK, wanted_Hz, 2e-8)
    allowed_Hz = state[0].allowed_Hz
    assert 500.0 <= allowed_Hz <= 5000.0
    assert not any(low <= allowed_Hz <= high for low, high in bands)


def _settle(p: Any, s: Any, events: int, wanted_Hz: float, wanted_m: float, steps: int = 200) -> None:
    for _ in range(steps):
        allow(p, s, events, wanted_Hz, wanted_m)


def test_each_limit_has_its_code() -> None:
    p, s = _start()
    allow(p, s, BLOCK, 3000.0, 2e-8)
    assert (s.limit, s.allowed_m) == (wire.SLEW, 1e-9)
    _settle(p, s, BLOCK, 3000.0, 2e-8)
    assert (s.limit, s.allowed_m) == (wire.NO_LIMIT, 2e-8)
    _settle(p, s, BLOCK, 3000.0, 1.0)
    assert (s.limit, s.allowed_m) == (wire.RANGE, 1e-7)
    _settle(p, s, BLOCK, 4800.0, 2e-8)
    assert (s.limit, s.allowed_Hz) == (wire.FREQUENCY_BAND, 4599.0)
    _settle(p, s, BLOCK, 2100.0, 2e-8)
    assert (s.limit, s.allowed_Hz) == (wire.FREQUENCY_BAND, 2301.0)
    allow(p, s, BLOCK, math.nan, 2e-8)
    assert s.limit == wire.NOT_FINITE


def test_stale_input_ramps_to_zero_and_fresh_input_ends_it() -> None:
    p, s = _start()
    _settle(p, s, BLOCK, 3000.0, 2e-8)
    _settle(p, s, STALE, 3000.0, 2e-8, steps=10)
    assert s.limit == wire.STALE_INPUT
    assert 0.0 < s.allowed_m < 2e-8
    _settle(p, s, STALE, 3000.0, 2e-8)
    assert s.allowed_m == 0.0
    _settle(p, s, BLOCK, 3000.0, 2e-8)
    assert s.allowed_m == 2e-8


def test_operator_stop_stays_until_reset() -> None:
    p, s = _start()
    _settle(p, s, BLOCK, 3000.0, 2e-8)
    allow(p, s, BLOCK | STOP, 3000.0, 2e-8)
    _settle(p, s, BLOCK, 3000.0, 2e-8)
    assert (s.limit, s.allowed_m) == (wire.OPERATOR_STOP, 0.0)
    allow(p, s, BLOCK | RESET, 3000.0, 2e-8)
    _settle(p, s, BLOCK, 3000.0, 2e-8)
    assert s.allowed_m == 2e-8
