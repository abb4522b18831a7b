"""The measuring chain of a synthetic rig: noise, hum, a slow drift, range and resolution, besides any effect.

The chain is drawn for every rig, so a diagnosis that is tuned to one measuring chain fails on the next rig.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from bridge.arrays import Floats
from plant.config import SensorsConfig

_REFERENCE_HZ = 20_000.0  # the noise levels are rms values of 20 kHz records


class DrawnChain(NamedTuple):
    """One measuring chain; arrays have one value for each of `bridge.wire.channels.CHANNELS`."""

    sensors: SensorsConfig  # bandwidths, range and resolution
    noise: Floats  # rms [unit of the channel]
    pink_share: float  # share of the noise power that is pink (1/f); the rest is white
    hum: Floats  # amplitude [unit of the channel]
    hum_Hz: float
    drift_N: float  # drift of the force over a run


def draw_chain(random: np.random.Generator, sensors: SensorsConfig, force_scale: float) -> DrawnChain:
    """Draw a chain; `force_scale` is the static friction relative to the paper's pair, and scales the errors of the force."""
    force_N = force_scale * _log_uniform(random, 0.005, 0.040)
    accel_mps2 = _log_uniform(random, 0.0015, 0.05)
    position_m = _log_uniform(random, 5e-8, 1e-6)
    noise = np.array([force_N, accel_mps2, accel_mps2, position_m, position_m])
    # hum of 0 to 20 mN on the force, for any noise; on the other channels the same ratio to the noise, or less
    hum_share = force_scale * random.uniform(0.0, 0.020) / force_N
    hum = hum_share * noise * np.concatenate([[1.0], random.uniform(0.0, 1.0, 4)])
    wide_open = random.random(3) < 0.5
    # a first-order filter far above the highest sampling rate, 100 kHz, has no effect
    open_to = {"force_bandwidth_Hz": 1e6, "accel_bandwidth_Hz": 1e6, "position_bandwidth_Hz": 1e6}
    changed: dict[str, float] = {
        name: f_Hz for (name, f_Hz), is_open in zip(open_to.items(), wide_open, strict=True) if is_open
    }
    changed["position_linearity"] = random.uniform(0.0, sensors.position_linearity)
    return DrawnChain(
        sensors.model_copy(update=changed),
        noise,
        random.uniform(0.0, 1.0),
        hum,
        float(random.choice([50.0, 60.0])) * (1.0 + random.normal(0.0, 2e-4)),  # the grid keeps 0.02 %
        force_scale * random.uniform(0.0, 0.010),
    )


def measured(random: np.random.Generator, chain: DrawnChain, analogue: Floats, rate_Hz: float) -> Floats:
    """The signals [5, samples] that the chain reports for the analogue signals [5, samples], in the order of `CHANNELS`."""
    samples = analogue.shape[1]
    t_s = np.arange(samples) / rate_Hz
    phase_rad = random.uniform(0.0, 2.0 * math.pi)
    hum = np.sin(2.0 * math.pi * chain.hum_Hz * t_s + phase_rad)
    # rectifiers give the mains a third harmonic
    hum += random.uniform(0.0, 0.4) * np.sin(6.0 * math.pi * chain.hum_Hz * t_s + 3.0 * phase_rad)
    result = analogue + chain.hum[:, None] * hum
    share = t_s / t_s[-1]
    slow = random.normal(0.0, 0.5) * share + 0.5 * np.sin(math.pi * share + random.uniform(0.0, 2.0 * math.pi))
    result[0] += chain.drift_N * slow
    # white noise has a density, not a level: its rms grows with the root of the sampling rate
    level = math.sqrt(rate_Hz / _REFERENCE_HZ)
    for row in range(len(result)):
        result[row] += chain.noise[row] * level * _noise(random, samples, chain.pink_share)
    sensors = chain.sensors
    _digital(result[0], -sensors.force_range_N, sensors.force_range_N, sensors.force_resolution_N)
    for row in (1, 2):
        _digital(result[row], -sensors.accel_range_mps2, sensors.accel_range_mps2, sensors.accel_resolution_mps2)
    for row in (3, 4):
        along = analogue[row] / sensors.position_range_m
        result[row] += 4.0 * sensors.position_linearity * sensors.position_range_m * along * (1.0 - along)
        _digital(result[row], 0.0, sensors.position_range_m, sensors.position_resolution_m)
    return result


def _noise(random: np.random.Generator, samples: int, pink_share: float) -> Floats:
    """Noise of unit rms, [samples]: white, with a share of the power that falls with 1/f."""
    white = random.standard_normal(samples)
    spectrum: Any = np.fft.rfft(random.standard_normal(samples))
    at = np.arange(len(spectrum), dtype=np.float64)
    at[0] = np.inf  # no constant part: an offset is a separate effect
    pink = np.fft.irfft(spectrum / np.sqrt(at), samples)
    return math.sqrt(1.0 - pink_share) * white + math.sqrt(pink_share) * pink / pink.std()


def _digital(values: Floats, low: float, high: float, resolution: float) -> None:
    if resolution > 0.0:
        np.rint(values / resolution, out=values)
        values *= resolution
    np.clip(values, low, high, out=values)


def _log_uniform(random: np.random.Generator, low: float, high: float) -> float:
    return math.exp(random.uniform(math.log(low), math.log(high)))
