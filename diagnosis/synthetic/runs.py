"""Runs of a synthetic rig: their plans, the ladder of runs, and the simulation from a random start to the columns of a file.

Two lengths of drive travel determine a stick-slip run with the paper's pair: the spring turns from +17 N to -17 N over 2.9 mm,
and a period takes about 0.5 mm. So a dwell lasts 0.25 s at 2 mm/s, 1 s at 0.5 mm/s and 5 s at 0.1 mm/s.
"""

import math
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.arrays import Floats
from bridge.wire.channels import CHANNELS
from diagnosis.features.grid import BLOCK_S
from plant.config import RigConfig, SensorsConfig
from plant.effects.drive import even_m, extension_m
from plant.records import TRUTH, build
from plant.simulate import run_blocks

Columns = dict[str, npt.NDArray[Any]]

_SAME_PLACE_M = 2e-5  # standard deviation of the position at which a run starts
_RAMP_S = 0.05  # duration of a change of velocity
_AMPLITUDE_M = 2e-8  # amplitude of the vibration in the paper
_PRIMER_M = 1e-15  # amplitude that turns the exciter's phase without moving the rig
RATE_HZ = 20_000.0  # sampling rate of the records, to which the noise levels belong


class DrawnChain(NamedTuple):
    """One measuring chain; arrays have one value for each of `bridge.wire.channels.CHANNELS`."""

    sensors: SensorsConfig  # bandwidths, range and resolution
    noise: Floats  # rms [unit of the channel]
    pink_share: float  # share of the noise power that is pink (1/f); the rest is white
    hum: Floats  # amplitude [unit of the channel]
    hum_Hz: float
    drift_N: float  # drift of the force over a run


class DrawnRig(NamedTuple):
    """The drawn rig, which is measured."""

    config: RigConfig
    chain: DrawnChain


class Vibration(NamedTuple):
    """Command to the piezo from a time on; an amplitude of 0 turns it off."""

    from_s: float
    frequency_Hz: float
    amplitude_m: float


class RunPlan(NamedTuple):
    """A run with a spring drive."""

    velocity: tuple[tuple[float, float], ...]  # points [s, m/s], linear in between; one point: constant
    vibration: tuple[Vibration, ...] = ()
    duration_s: float = 10.0
    holdout: bool = False
    track: int = 0  # runs with the same number start at the same position

    def columns(self, random: np.random.Generator, rig: DrawnRig, start_m: float) -> Columns:
        """Drag the slide from about `start_m` on; return the columns of the run, [samples] each, SI units."""
        params, state = build(rig.config)
        blocks = round(self.duration_s / BLOCK_S)
        force_N = random.uniform(0.3, 0.95) * float(params[0].F_c)
        at_rest(random, params, state, force_N, start_m + random.normal(0.0, _SAME_PLACE_M))
        points = np.array(self.velocity)
        velocity_mps = np.interp(np.arange(blocks) * BLOCK_S, points[:, 0], points[:, 1])
        frequency_Hz, amplitude_m = np.zeros(blocks), np.zeros(blocks)
        for step in self.vibration:
            at = round(step.from_s / BLOCK_S)
            frequency_Hz[at:], amplitude_m[at:] = step.frequency_Hz, step.amplitude_m
        analogue = np.empty((len(CHANNELS), blocks * round(RATE_HZ * BLOCK_S)))
        truth = np.empty((len(TRUTH), analogue.shape[1]))
        commanded_Hz, commanded_m = _primed(random, frequency_Hz, amplitude_m)
        run_blocks(params, state, velocity_mps, commanded_Hz, commanded_m, analogue, truth)
        rows = measured(random, rig.chain, analogue, RATE_HZ)
        columns: Columns = {"t_s": np.arange(rows.shape[1]) / RATE_HZ}
        columns |= {name: values.astype(np.float32) for name, values in zip(CHANNELS, rows, strict=True)}
        if self.vibration:
            block = (columns["t_s"] / BLOCK_S + 1e-6).astype(np.int64)
            columns["vibration_frequency_Hz"] = frequency_Hz[block]
            columns["vibration_amplitude_m"] = amplitude_m[block]
        return columns


def steps(*steps: tuple[float, float]) -> tuple[tuple[float, float], ...]:
    """A velocity profile that changes to each velocity at its time, over a short ramp."""
    points = [steps[0]]
    for time_s, velocity_mps in steps[1:]:
        points += [(time_s, points[-1][1]), (time_s + _RAMP_S, velocity_mps)]
    return tuple(points)


def constant(velocity_mps: float) -> tuple[tuple[float, float], ...]:
    """A velocity profile of one velocity."""
    return ((0.0, velocity_mps),)


def vibration(*steps: tuple[float, float]) -> tuple[Vibration, ...]:
    """Vibration with the paper's amplitude: [s, Hz] each, from this time on; a frequency of 0 is off."""
    return tuple(Vibration(time_s, f_Hz, _AMPLITUDE_M if f_Hz > 0.0 else 0.0) for time_s, f_Hz in steps)


# the shortest protocol that separates ageing, direction, position, piezo and drive
LADDER: Final = (
    RunPlan(constant(0.0005), track=0),
    # 3 mm forward; 5 mm back, of which 2.1 mm slide; 0.9 mm of slow drag with dwells of 3 s
    RunPlan(steps((0.0, 0.002), (1.5, -0.002), (4.0, -0.00015)), track=1),
    # frequencies in no order: if they rose with time, a roll-off would look like an exciter that warms up
    RunPlan(constant(0.0005), vibration((2.0, 3000.0), (4.0, 1000.0), (6.0, 4500.0), (8.0, 2000.0)), track=2),
    RunPlan(
        steps((0.0, 0.0007), (5.0, -0.002), (7.2, -0.0002)),
        vibration((2.5, 2500.0), (5.0, 0.0)),
        holdout=True,
        track=3,
    ),
)


def at_rest(random: np.random.Generator, params: Any, state: Any, force_N: float, position_m: float) -> None:
    """Set the state to a slide at rest under a spring force, consistent with springs, sensors and delays."""
    p, s = params[0], state[0]
    s.x, s.z = position_m, force_N / p.k_t
    s.age_s = random.uniform(1.0, 30.0)
    s.frame_m, s.base_m = force_N * p.frame_m_per_N, force_N * p.base_m_per_N
    s.s_d = position_m + s.frame_m + extension_m(p, force_N)
    s.even_m = even_m(p, s.s_d)
    s.drive_N = s.force_f = force_N
    s.force_lag[:] = force_N
    s.delay_line[:] = force_N
    s.mass_position_f, s.drive_position_f = s.x, s.s_d


def _primed(random: np.random.Generator, frequency_Hz: Floats, amplitude_m: Floats) -> tuple[Floats, Floats]:
    """The commands to the piezo, with a block of `_PRIMER_M` before each start, which shifts the phase by a random angle."""
    commanded_Hz, commanded_m = frequency_Hz.copy(), amplitude_m.copy()
    for start in np.flatnonzero((amplitude_m[1:] > 0.0) & (amplitude_m[:-1] == 0.0)):
        commanded_Hz[start] = random.uniform(0.5, 1.5) / BLOCK_S
        commanded_m[start] = _PRIMER_M
    return commanded_Hz, commanded_m


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
    level = math.sqrt(rate_Hz / RATE_HZ)
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
