"""The sensor chain of an ordinary rig: bandwidth, linearity, noise, hum, slow drift, resolution. None is an effect."""

from dataclasses import dataclass

import numpy as np

from tests.blind.generator.effect import Signals
from tests.blind.generator.kernel import SAMPLE_RATE_HZ

RANGE_m = 0.050  # of a displacement sensor
# data sheets give the frequency at which an accelerometer reads 5 % low; a single pole does so at 0.33 of its corner
ACCEL_POLE_Hz = 10_000.0 / np.sqrt(1.0 / 0.95**2 - 1.0)


def _log_uniform(random: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


@dataclass(frozen=True)
class Channel:
    """One column's imperfections."""

    noise_rms: float
    pink_share: float  # of the noise power
    hum: float  # amplitude at mains_Hz
    drift: float  # amplitude of the slow wander
    resolution: float
    low_pass_Hz: float = 0.0  # second order; 0: open
    pole_Hz: float = 0.0  # first order; 0: open
    high_pass_Hz: float = 0.0
    bow_m: float = 0.0  # deviation of a displacement sensor in the middle of its range


@dataclass(frozen=True)
class Chain:
    mains_Hz: float
    channels: dict[str, Channel]


def draw_chain(random: np.random.Generator) -> Chain:
    """The sensors of one rig."""

    def accel() -> Channel:
        return Channel(
            noise_rms=_log_uniform(random, 0.0015, 0.05),
            pink_share=random.uniform(0.0, 0.6),
            hum=random.uniform(0.0, 0.003),
            drift=0.0,
            resolution=float(random.choice((0.0005, 0.001, 0.002))),
            pole_Hz=float(random.choice((0.0, ACCEL_POLE_Hz))),
            high_pass_Hz=float(random.choice((0.0, random.uniform(0.05, 0.5)))),
        )

    def displacement(low_pass_Hz: float) -> Channel:
        return Channel(
            noise_rms=_log_uniform(random, 0.05e-6, 1e-6),
            pink_share=random.uniform(0.0, 0.6),
            hum=random.uniform(0.0, 0.2e-6),
            drift=random.uniform(0.0, 0.2e-6),
            resolution=float(random.choice((0.02e-6, 0.05e-6, 0.1e-6))),
            low_pass_Hz=low_pass_Hz,
            bow_m=RANGE_m * random.uniform(-0.002, 0.002),
        )

    mains_Hz = float(random.choice((50.0, 60.0)))
    force = Channel(
        noise_rms=_log_uniform(random, 0.005, 0.040),
        pink_share=random.uniform(0.0, 0.6),
        hum=random.uniform(0.0, 0.020),
        drift=random.uniform(0.0, 0.010),
        resolution=float(random.choice((0.0005, 0.001, 0.002))),
        low_pass_Hz=float(random.choice((0.0, 2000.0))),
    )
    low_pass_Hz = float(random.choice((0.0, 800.0)))  # both displacement sensors are of one make
    return Chain(
        mains_Hz=mains_Hz,
        channels={
            "drive_force_N": force,
            "mass_accel_mps2": accel(),
            "base_accel_mps2": accel(),
            "mass_position_m": displacement(low_pass_Hz),
            "drive_position_m": displacement(low_pass_Hz),
        },
    )


def _response(channel: Channel, frequency_Hz: np.ndarray) -> np.ndarray:
    s = 1j * frequency_Hz
    response = np.ones(len(frequency_Hz), complex)
    if channel.low_pass_Hz:
        r = s / channel.low_pass_Hz
        response /= 1.0 + np.sqrt(2.0) * r + r * r
    if channel.pole_Hz:
        response /= 1.0 + s / channel.pole_Hz
    if channel.high_pass_Hz:
        response *= s / (s + channel.high_pass_Hz)
    return response


def _filtered(channel: Channel, signal: np.ndarray) -> np.ndarray:
    """The signal after the analogue response, by Fourier transform; before the run the signal has its first value.

    The first value is subtracted, and the end is led back to the start over 2 s, so that the wrap-around of the
    transform meets a signal at rest.
    """
    if not (channel.low_pass_Hz or channel.pole_Hz or channel.high_pass_Hz):
        return signal
    samples, tail = len(signal), 2 * SAMPLE_RATE_HZ
    first = signal[0] * (channel.high_pass_Hz == 0.0)
    back = 0.5 * (1.0 + np.cos(np.pi * np.arange(tail) / tail)) * (signal[-1] - first)
    padded = np.concatenate((signal - first, back, np.zeros(tail)))
    spectrum = np.fft.rfft(padded)
    spectrum *= _response(channel, np.fft.rfftfreq(len(padded), 1.0 / SAMPLE_RATE_HZ))
    return np.fft.irfft(spectrum, len(padded))[:samples] + first


def _noise(random: np.random.Generator, channel: Channel, samples: int) -> np.ndarray:
    white = random.standard_normal(samples)
    spectrum = np.fft.rfft(random.standard_normal(samples))
    frequency = np.fft.rfftfreq(samples, 1.0 / SAMPLE_RATE_HZ)
    spectrum[1:] *= (np.maximum(frequency[1:], 0.1)) ** -0.5  # 1/f in power, flat below 0.1 Hz
    spectrum[0] = 0.0
    pink = np.fft.irfft(spectrum, samples)
    share = channel.pink_share
    return channel.noise_rms * (np.sqrt(1.0 - share) * white + np.sqrt(share) * pink / pink.std())


def measure(random: np.random.Generator, chain: Chain, signals: Signals, scale: float) -> Signals:
    """The recorded signals for the true signals of one run; `scale` 0 is an ideal chain, 1 the drawn chain."""
    if scale == 0.0:
        return signals
    measured = dict(signals)
    t_s = signals["t_s"]
    for name, channel in chain.channels.items():
        values = _filtered(channel, signals[name])
        share = values / RANGE_m
        values = values + scale * channel.bow_m * 4.0 * share * (1.0 - share) if channel.bow_m else values
        mains_rad, wander_rad = random.uniform(0.0, 2.0 * np.pi, 2)
        slow_Hz = random.uniform(0.02, 0.15)
        wander = np.sin(2.0 * np.pi * slow_Hz * t_s + wander_rad)
        hum = np.sin(2.0 * np.pi * chain.mains_Hz * t_s + mains_rad)
        noise = _noise(random, channel, len(t_s)) + channel.hum * hum + channel.drift * wander
        values = values + scale * noise
        measured[name] = np.round(values / channel.resolution) * channel.resolution
    return measured
