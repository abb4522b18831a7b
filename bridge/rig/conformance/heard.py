"""The blocks of a session, and the tone in them."""

import math
from typing import NamedTuple

import numpy as np

from bridge.arrays import Floats
from bridge.wire.channels import CHANNELS

BASE = CHANNELS.index("base_accel_mps2")
_LOWEST_HZ = 50.0  # lowest frequency of a tone that is looked for


class Block(NamedTuple):
    """One block."""

    number: int  # lost blocks are counted
    at_s: float  # time at which it was read, by the computer's clock
    samples: Floats  # SI units [channels, samples], rows as CHANNELS; absent ones are zeros
    frequency_Hz: float  # of the exciter at the block's end, as reported
    amplitude_m: float


Stage = list[Block]


class Tone(NamedTuple):
    """The strongest tone of a channel."""

    frequency_Hz: float
    amplitude: float  # in the channel's unit


def joined(stage: Stage) -> Floats:
    """Samples of a stage [channels, samples]."""
    return np.concatenate([block.samples for block in stage], axis=1) if stage else np.zeros((len(CHANNELS), 0))


def strongest(samples: Floats, rate_Hz: float) -> Tone:
    """The strongest tone of one channel above 50 Hz, within 0.1 % of its frequency for 0.2 s of samples."""
    values = samples[np.isfinite(samples)]
    if len(values) < 8:
        return Tone(0.0, 0.0)
    window = np.hanning(len(values))
    spectrum = np.abs(np.fft.rfft((values - values.mean()) * window)) * 2.0 / window.sum()
    spectrum[: max(math.ceil(_LOWEST_HZ * len(values) / rate_Hz), 2)] = 0.0
    at = int(spectrum.argmax())
    if not 0 < at < len(spectrum) - 1 or spectrum[at] == 0.0:
        return Tone(at * rate_Hz / len(values), float(spectrum[at]))
    left, peak, right = np.log(np.maximum(spectrum[at - 1 : at + 2], 1e-300))
    shift = 0.5 * (left - right) / (left - 2.0 * peak + right) if left - 2.0 * peak + right else 0.0
    frequency_Hz = (at + shift) * rate_Hz / len(values)
    return Tone(frequency_Hz, level(values, frequency_Hz, rate_Hz))


def level(samples: Floats, frequency_Hz: float, rate_Hz: float) -> float:
    """Amplitude of a known frequency in one channel."""
    return float(abs(_phasors(samples[None, :], frequency_Hz, rate_Hz)[0]))


def phasors(stage: Stage, frequency_Hz: float, rate_Hz: float) -> Floats:
    """Complex amplitude of the base's acceleration in each block, its phase by the blocks' numbers."""
    rows = np.array([block.samples[BASE] for block in stage])
    starts_s = np.array([block.number for block in stage]) * rows.shape[1] / rate_Hz
    return _phasors(rows, frequency_Hz, rate_Hz) * np.exp(-2j * math.pi * frequency_Hz * starts_s)


def displacements(stage: Stage, frequency_Hz: float, rate_Hz: float) -> Floats:
    """Amplitude of the base's displacement in each block [m]."""
    return np.abs(phasors(stage, frequency_Hz, rate_Hz)) / (2.0 * math.pi * frequency_Hz) ** 2


def _phasors(rows: Floats, frequency_Hz: float, rate_Hz: float) -> Floats:
    """Complex amplitude of the sine that fits each row best; missing samples count as their row's mean."""
    angle = 2.0 * math.pi * frequency_Hz / rate_Hz * np.arange(rows.shape[1])
    shapes = np.stack([np.cos(angle), np.sin(angle), np.ones_like(angle)])
    filled = np.where(np.isfinite(rows), rows, 0.0)
    fit = np.linalg.lstsq(shapes.T, filled.T, rcond=None)[0]
    return fit[0] - 1j * fit[1]
