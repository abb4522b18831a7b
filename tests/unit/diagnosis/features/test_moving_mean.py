"""The compiled moving mean against scipy's."""

import numpy as np
import pytest
from scipy.ndimage import uniform_filter1d

from diagnosis.features.moving_mean import moving_mean


@pytest.mark.parametrize(("blocks", "width"), [(1000, 5), (1000, 100), (50, 100), (40, 100), (7, 1), (1, 5)])
def test_it_is_scipy_s_filter_bit_by_bit(blocks: int, width: int) -> None:
    values = 20.0 + np.random.default_rng(1).normal(size=blocks)
    assert np.array_equal(moving_mean(values, width), uniform_filter1d(values, width))
