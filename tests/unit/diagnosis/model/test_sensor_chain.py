"""The sensor chain applied to predicted signals."""

import numpy as np
import pytest

from diagnosis.features.grid import BLOCK_S
from diagnosis.model.sensor_chain import delayed


@pytest.mark.parametrize("blocks", [0.0, 1.0, 6.0, -3.0, 49.0, 60.0, -60.0])
def test_a_delay_of_whole_blocks_shifts_and_is_level_beyond_the_ends(blocks):
    values = np.random.default_rng(3).normal(size=50)
    at = np.arange(50.0)
    assert delayed(values, blocks * BLOCK_S) == pytest.approx(np.interp(at - blocks, at, values), abs=1e-12)


@pytest.mark.parametrize("blocks", [0.3, 0.5, 2.75, -0.4, -7.5])
def test_a_delay_between_blocks_keeps_a_cubic(blocks):
    """And so smooths nothing up to the third derivative."""
    at = np.arange(60.0)
    cubic = np.polynomial.Polynomial([1.0, -0.7, 0.02, 3e-4])
    inside = slice(12, -12)
    assert delayed(cubic(at), blocks * BLOCK_S)[inside] == pytest.approx(cubic(at - blocks)[inside], rel=1e-12)
