"""The amplitude loop keeps its margins for every delay that was measured, and for errors of the delay of some milliseconds."""

from typing import Any

import pytest

from controller.config import ControllerConfig
from controller.records import build
from tests.unit.controller.loop_design import margins


def shares(block_s: float) -> tuple[float, float, float]:
    samples = max(round(20 * block_s / 1e-3), 10)
    params: Any = build(ControllerConfig(block_s=block_s, samples_per_block=samples))[0][0]
    return float(params.learn_share), float(params.filter_share), block_s


@pytest.mark.parametrize("block_s", [1e-3, 2e-3, 5e-3, 1e-2])
@pytest.mark.parametrize("delay_s", [0.0, 0.01, 0.02, 0.05])
def test_a_delay_that_is_a_block_off_leaves_sixty_degrees(block_s: float, delay_s: float) -> None:
    learn, low_pass, block_s = shares(block_s)
    delay_blocks = round(delay_s / block_s)
    designed = margins(learn, low_pass, delay_blocks + 1, delay_blocks, block_s)
    assert designed.phase_margin_deg >= 60.0
    assert designed.gain_margin >= 1.8


def test_the_margins_shrink_with_the_error_of_the_delay() -> None:
    learn, low_pass, block_s = shares(1e-3)
    designed = [margins(learn, low_pass, 20 + off, 20, block_s).gain_margin for off in (1, 3, 10, 30)]
    assert designed == sorted(designed, reverse=True)
    assert designed[2] > 1.0  # 10 ms, the time constant of learning


def test_a_known_delay_feeds_nothing_back() -> None:
    learn, low_pass, block_s = shares(1e-3)
    assert margins(learn, low_pass, 40, 40, block_s).phase_margin_deg == 180.0


def test_a_delay_below_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match="delay_blocks = -1"):
        margins(0.1, 0.2, -1, 0)
