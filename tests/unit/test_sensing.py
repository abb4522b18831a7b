"""What the sensors make of predicted signals."""

import numpy as np
import pytest

from diagnosis.reduced import BLOCK_S
from diagnosis.sensing import delayed


@pytest.mark.parametrize("blocks", [0.0, 0.3, 1.0, 2.75, -0.4, -3.0, 49.5, 60.0, -60.0])
def test_a_delay_is_linear_between_blocks_and_level_beyond_the_ends(blocks):
    values = np.random.default_rng(3).normal(size=50)
    at = np.arange(50.0)
    assert delayed(values, blocks * BLOCK_S) == pytest.approx(np.interp(at - blocks, at, values), abs=1e-12)
