"""A single outlier is replaced; a step, a kink and noise are kept; faults that one channel shows."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from bridge.config import validate
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import sensor_block
from controller.config import ControllerConfig
from controller.estimate.channels import bin_means, has_jumped, is_noisy, is_usable, note_resolution, watch_channels
from controller.estimate.windows import DRIVE, FORCE, SLIDE
from controller.records import build

SAMPLES, BINS = 20, 10
NOISE = {"drive_force_N": 0.1, "mass_position_m": 5e-7, "drive_position_m": 5e-7, "base_accel_mps2": 0.01}
ROWS = {"drive_force_N": FORCE, "mass_position_m": SLIDE, "drive_position_m": DRIVE}
N = np.arange(SAMPLES)


class Ear:
    """A controller's memory, and blocks in noise that it conditions."""

    def __init__(self, seed: int = 7, samples: int = SAMPLES, blocks: int = 50, **estimator: Any) -> None:
        table = {"estimator": estimator, "samples_per_block": samples, "block_s": 5e-5 * samples}
        params, state = build(validate(ControllerConfig, table, "test"))
        self.p, self.s = params[0], state[0]
        self.random = np.random.default_rng(seed)
        self.block = sensor_block(samples).blank()[0]
        for _ in range(blocks):
            assert self.look()

    def look(self, **more: npt.NDArray[np.float64] | float) -> bool:
        """Condition a block of noise, with `more` added to its channels."""
        for channel, rms in NOISE.items():
            self.block[channel] = (
                10.0 * rms + rms * self.random.standard_normal(len(self.block[channel])) + more.get(channel, 0.0)
            )
        return self.again()

    def again(self) -> bool:
        usable = bool(is_usable(self.p, self.s, self.block))
        if usable:
            samples, bin_samples = len(self.block["drive_force_N"]), int(self.p["bin_samples"])
            for first in range(0, samples, BINS * bin_samples):
                bins = min(BINS, (samples - first) // bin_samples)
                bin_means(self.p, self.s, self.block, first, bins)
                self.s.pushed[0] += bins
            watch_channels(self.p, self.s)
        return usable

    def mean(self, channel: str) -> float:
        return float(self.s.fresh[ROWS[channel], :BINS].mean())


@pytest.fixture
def ear() -> Ear:
    return Ear()


@pytest.mark.parametrize("channel", ROWS)
@pytest.mark.parametrize("at", [0, 1, 7, SAMPLES - 1])
@pytest.mark.parametrize("off", [100.0, -100.0, 1e6])
def test_a_single_outlier_is_replaced(ear: Ear, channel: str, at: int, off: float) -> None:
    noise = NOISE[channel]
    assert ear.look(**{channel: off * noise * (at == N)})
    assert ear.mean(channel) == pytest.approx(10.0 * noise, abs=noise)
    for _ in range(3):
        ear.look()
        assert ear.mean(channel) == pytest.approx(10.0 * noise, abs=noise)
    assert ear.s.trip == 0


def test_noise_is_kept(ear: Ear) -> None:
    for _ in range(500):
        ear.look()
        assert ear.mean("drive_force_N") == pytest.approx(ear.block.drive_force_N.mean(), rel=1e-5)
    assert ear.s.jumps == 0.0


@pytest.mark.parametrize("at", [1, 2, 10, SAMPLES - 2])
@pytest.mark.parametrize("channel", ["drive_force_N", "mass_position_m"])
@pytest.mark.parametrize("is_kink", [False, True])
def test_a_change_of_force_or_slide_that_lasts_is_kept(ear: Ear, channel: str, is_kink: bool, at: int) -> None:
    more = 50.0 * NOISE[channel] * (np.maximum(N - at, 0) if is_kink else 1.0 * (at <= N))
    ear.look(**{channel: more})
    ear.look(**{channel: more[-1]})
    last = ear.s.fresh[ROWS[channel], BINS - 1]
    assert last == pytest.approx(10.0 * NOISE[channel] + more[-1], abs=4.0 * NOISE[channel])
    assert ear.s.offset_m == 0.0


@pytest.mark.parametrize("at", [0, 1, 10, SAMPLES - 1])
def test_a_step_of_the_drive_position_is_subtracted_and_reported(ear: Ear, at: int) -> None:
    ear.look(drive_position_m=1e-3 * (at <= N))
    for _ in range(20):
        ear.look(drive_position_m=1e-3)
        assert ear.mean("drive_position_m") == pytest.approx(5e-6, abs=2e-6)
    assert has_jumped(ear.s)
    assert ear.s.trip == 0


def test_an_encoder_without_noise_that_is_read_once_a_block_may_move_at_once(ear: Ear) -> None:
    drive_m = 0.0
    for number in range(600):
        drive_m += 1e-6 if number > 400 else 0.0
        ear.block.drive_position_m[:] = 5e-6 + drive_m
        ear.again()
    assert ear.s.doubted == 0
    assert ear.s.last[DRIVE] == pytest.approx(5e-6 + drive_m, abs=1e-6)


def test_steps_that_repeat_are_a_broken_encoder(ear: Ear) -> None:
    for number in range(60):
        ear.look(drive_position_m=1e-3 * (number // 10))
    assert ear.s.trip == wire.DRIVE_DOUBTED


def test_a_step_of_both_positions_is_a_wrong_reference(ear: Ear) -> None:
    for _ in range(2):
        ear.look(drive_position_m=1e-4, mass_position_m=1e-4)
    assert ear.s.trip == wire.DRIVE_DOUBTED


def test_noise_of_the_drive_that_grows_counts_in_all_windows_and_is_reported(ear: Ear) -> None:
    ear.s.noise[DRIVE, :] = ear.s.sigma[DRIVE, :] = 1e-6
    for _ in range(30):
        ear.look(drive_position_m=5e-5 * ear.random.standard_normal(SAMPLES))
    assert is_noisy(ear.s)
    assert ear.s.noise[DRIVE, :10].min() > 8e-6
    assert ear.s.usual[DRIVE] > 1e-5
    assert ear.s.doubted == 0


@pytest.mark.parametrize("samples", [6, SAMPLES, 100])
def test_white_noise_neither_grows_nor_steps_as_a_rig_starts(samples: int) -> None:
    for seed in range(30):
        ear = Ear(seed, samples, blocks=0)
        for _ in range(2000 // samples):
            ear.look()
            assert ear.s.grown_s == 0.0
        assert ear.s.jumps == 0.0
        assert ear.s.offset_m == 0.0


@pytest.mark.parametrize("channel", ["drive_force_N", "mass_position_m", "base_accel_mps2"])
def test_a_channel_with_noise_that_repeats_its_block_is_frozen(ear: Ear, channel: str) -> None:
    ear.s.moving, ear.s.least_mps[:] = 1, 1e-3
    for _ in range(15):
        kept = ear.block[channel].copy()
        ear.look()
        ear.block[channel] = kept
        ear.again()
    assert ear.s.trip == wire.FROZEN


def test_a_channel_without_noise_may_repeat_its_number() -> None:
    ear = Ear(use_force=False)
    ear.s.moving, ear.s.usual[SLIDE], ear.s.resolution[SLIDE] = 1, 4e-7, 1e-6
    for _ in range(300):
        ear.again()
    assert ear.s.repeats[SLIDE] == 0.0
    assert ear.s.trip == 0


@pytest.mark.parametrize("channel", NOISE)
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 3e38])
def test_a_block_with_no_number_is_not_used(ear: Ear, channel: str, value: float) -> None:
    for at in (0, 9, SAMPLES - 1):
        assert ear.look()
        ear.block[channel][at] = value
        assert not ear.again()
        assert ear.look()


def test_a_channel_that_is_left_out_is_not_looked_at() -> None:
    ear = Ear(use_force=False)
    assert ear.look(drive_force_N=np.where(N == 4, math.nan, 0.0))


def test_the_resolution_is_the_smallest_change(ear: Ear) -> None:
    ear.s.resolution[SLIDE] = 0.0
    note_resolution(ear.s, SLIDE, np.array([0.0, 1e-6, 3e-6], np.float32))
    assert ear.s.resolution[SLIDE] == pytest.approx(1e-6, rel=1e-3)
