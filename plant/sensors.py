"""The digital half of the sensors: gain, linearity, noise, range and resolution."""

import math
from typing import Any

import numpy.typing as npt

from bridge.kernel import kernel
from bridge.layouts import PlantParams, SensorRow


@kernel
def _digital(value: float, low: float, high: float, resolution: float) -> float:
    if resolution > 0.0:
        value = math.floor(value / resolution + 0.5) * resolution
    return min(max(value, low), high)


@kernel
def _position(p: PlantParams, true_m: float, noise: float) -> float:
    # nonlinearity: a bow over the whole range, whose largest deviation is position_linearity times the range
    lowest_m, highest_m = p.position_lowest_m, p.position_range_m
    share = (true_m - lowest_m) / (highest_m - lowest_m)
    bow_m = 4.0 * p.position_linearity * (highest_m - lowest_m) * share * (1.0 - share)
    measured_m = true_m + bow_m + p.position_noise_m * noise
    return _digital(measured_m, lowest_m, highest_m, p.position_resolution_m)


@kernel
def digitise(p: PlantParams, analogue: npt.NDArray[Any], noise: npt.NDArray[Any], block: SensorRow) -> None:
    """Turn analogue signals into the samples that the rig's data acquisition reports.

    Args:
        p: record of `plant.records.PARAMS`.
        analogue: float64 [5, samples] from `plant.core.advance`, SI units.
        noise: standard normal numbers, float64 [5, samples].
        block: record of a sensor block; its channels, float32 [samples] each, are filled.

    """
    low_mps2, high_mps2 = -p.accel_range_mps2, p.accel_range_mps2
    for i in range(analogue.shape[1]):
        force_N = p.force_gain * analogue[0, i] + p.force_noise_N * noise[0, i]
        block.drive_force_N[i] = _digital(force_N, p.force_lowest_N, p.force_range_N, p.force_resolution_N)
        mass_mps2 = analogue[1, i] + p.accel_noise_mps2 * noise[1, i]
        block.mass_accel_mps2[i] = _digital(mass_mps2, low_mps2, high_mps2, p.accel_resolution_mps2)
        base_mps2 = analogue[2, i] + p.accel_noise_mps2 * noise[2, i]
        block.base_accel_mps2[i] = _digital(base_mps2, low_mps2, high_mps2, p.accel_resolution_mps2)
        block.mass_position_m[i] = _position(p, analogue[3, i], noise[3, i])
        block.drive_position_m[i] = _position(p, analogue[4, i], noise[4, i])
