"""The noise of replicates is noise alone, without the error of a moving mean at the ends of a run."""

import numpy as np

from diagnosis.features.feature import Scales
from diagnosis.features.noise import noise_of
from diagnosis.features.segments import CommandedRun, Segment
from diagnosis.features.spring_drive import spring_features

SCALES = Scales(17.0, 0.036, 0.5, 11700.0, 5.0)


def test_a_position_that_is_ramped_without_noise_has_none() -> None:
    blocks = 4000
    position_m = 5e-7 * np.arange(blocks)
    force_N = 15.0 + np.random.default_rng(1).normal(0.0, 0.02, blocks)
    still = np.zeros(blocks)
    commands = CommandedRun(np.full(blocks, 5e-4), still, still, (Segment(0, blocks, 5e-4, 0.0, 0.0),))
    noise = noise_of({"drive_force_N": force_N, "drive_position_m": position_m}, commands, SCALES)
    drawn_m = noise.drawn("drive_position_m", blocks, np.random.default_rng(2))
    # a mean over 21 blocks that mirrors the ramp at its ends would leave 2.6 um there
    assert np.abs(drawn_m).max() < 1e-15


def test_the_rounding_of_a_commanded_position_does_not_change_a_feature() -> None:
    blocks = 4000
    still = np.zeros(blocks)
    commands = CommandedRun(np.full(blocks, 5e-4), still, still, (Segment(0, blocks, 5e-4, 0.0, 0.0),))
    rests: list[float] = []
    for position_m in (5e-7 * np.arange(blocks), np.cumsum(np.full(blocks, 5e-7))):
        features = spring_features({"drive_position_m": position_m, "mass_accel_mps2": still + 1.0}, commands, SCALES)
        rests += [
            value for label, value in zip(features.labels, features.values, strict=True)
            if (label.name, label.signal) == ("rest", "drive_position_m")
        ]  # fmt: skip
    assert abs(0.5 * np.log(rests[1] / rests[0])) < 0.01
