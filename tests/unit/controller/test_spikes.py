"""A single outlier is replaced; a step, a kink and noise are kept."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from bridge.config import validate
from bridge.wire.messages import sensor_block
from controller.config import ControllerConfig
from controller.estimate.spikes import find_spikes, learn_bends, sum_without
from controller.estimate.windows import DRIVE, FORCE, SLIDE
from controller.records import build

SAMPLES = 20
NOISE_N = 0.1


class Ear:
    """A controller's memory, and blocks of force in noise that it looks at."""

    def __init__(self, **estimator: Any) -> None:
        params, state = build(validate(ControllerConfig, {"estimator": estimator}, "test"))
        self.p, self.s = params[0], state[0]
        self.s.tail[:, :], self.s.spike_at[:] = math.nan, -1
        self.random = np.random.default_rng(7)
        self.block = sensor_block(SAMPLES).blank()[0]
        for _ in range(50):
            assert self.look(self.quiet())
            learn_bends(self.p, self.s, FORCE, self.block)

    def quiet(self) -> npt.NDArray[np.float64]:
        return 10.0 + NOISE_N * self.random.standard_normal(SAMPLES)

    def look(self, force_N: npt.NDArray[np.float64]) -> bool:
        self.s.steps += 1
        self.block.drive_force_N[:] = force_N
        return bool(find_spikes(self.p, self.s, self.block))

    def total_N(self) -> float:
        return float(sum_without(self.s, FORCE, self.block.drive_force_N, 0, SAMPLES))


@pytest.fixture
def ear() -> Ear:
    return Ear()


@pytest.mark.parametrize("at", [0, 1, 7, SAMPLES - 2, SAMPLES - 1])
@pytest.mark.parametrize("off_N", [5.0, -5.0, 1e6, 3e38])
def test_a_single_outlier_is_replaced(ear: Ear, at: int, off_N: float) -> None:
    force_N = ear.quiet()
    without_N = force_N.sum()
    force_N[at] += off_N
    assert ear.look(force_N)
    assert ear.s.spike_at.tolist() == [at if row == FORCE else -1 for row in (FORCE, SLIDE, DRIVE)]
    assert ear.total_N() == pytest.approx(without_N, abs=8.0 * NOISE_N)


def test_a_channel_that_spikes_block_after_block_is_not_mended(ear: Ear) -> None:
    replaced: list[int] = []
    for _ in range(4):
        force_N = ear.quiet()
        force_N[9] = 3e38
        assert ear.look(force_N)
        replaced.append(int(ear.s.spike_at[FORCE]))
    assert replaced == [9, -1, -1, -1]


def test_noise_has_no_spikes(ear: Ear) -> None:
    for _ in range(500):
        force_N = ear.quiet()
        assert ear.look(force_N)
        assert ear.s.spiked == 0
        assert ear.total_N() == pytest.approx(force_N.sum(), rel=1e-6)


@pytest.mark.parametrize("at", [1, 2, 10, SAMPLES - 2])
@pytest.mark.parametrize("shape", ["step", "kink", "two"])
def test_a_change_that_lasts_is_kept(ear: Ear, shape: str, at: int) -> None:
    n = np.arange(SAMPLES)
    more_N = {"step": 5.0 * (n >= at), "kink": 5.0 * np.maximum(n - at, 0), "two": 5.0 * ((n == at) | (n == at + 1))}[
        shape
    ]
    ear.look(ear.quiet())
    assert ear.look(ear.quiet() + more_N)
    assert ear.s.spike_at[FORCE] in (-1, SAMPLES - 1)  # the last has no neighbour on its right
    assert ear.look(ear.quiet() + more_N[-1])
    assert ear.s.spiked == 0 or shape == "two"


def test_a_vibration_is_kept_and_becomes_the_known_noise(ear: Ear) -> None:
    wave_N = 5.0 * np.sin(2.0 * math.pi * 0.2 * np.arange(SAMPLES))
    known = ear.s.bends[FORCE]
    for _ in range(6):
        ear.look(ear.quiet() + wave_N)
        assert ear.s.spiked == 0
    assert ear.s.bends[FORCE] > 3.0 * known


@pytest.mark.parametrize("channel", ["drive_force_N", "mass_position_m", "drive_position_m", "base_accel_mps2"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_block_with_no_number_is_not_used(ear: Ear, channel: str, value: float) -> None:
    for at in (0, 1, 9, SAMPLES - 1):
        assert ear.look(ear.quiet())
        ear.block[channel][at] = value
        assert not find_spikes(ear.p, ear.s, ear.block)
        ear.block[channel][at] = 0.0
        ear.s.missing_blocks = 1
        assert ear.look(ear.quiet())
        ear.s.missing_blocks = 0


def test_a_channel_that_is_left_out_is_not_looked_at() -> None:
    ear = Ear(use_force=False)
    force_N = ear.quiet()
    force_N[4] = math.nan
    assert ear.look(force_N)
    assert ear.s.spiked == 0
