"""The counts of the stall harness."""

import numpy as np
import pytest

from tests.stalls import missing


@pytest.mark.parametrize(("numbers", "lost"), [([], 0), ([0, 1, 2], 0), ([0, 1, 1, 2], 0), ([2, 3], 2), ([0, 5, 3], 3)])
def test_numbers_that_are_not_there_are_counted(numbers: list[int], lost: int) -> None:
    assert missing(np.array(numbers, np.int64)) == lost
