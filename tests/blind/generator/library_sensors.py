"""Sensor effects of the library: they change the measured signals, and not the rig."""

import numpy as np
from scipy.signal import bessel, bilinear, lfilter

from tests.blind.generator.effect import Formula, Numbers, Signals, either
from tests.blind.generator.kernel import SAMPLE_RATE_HZ

Random = np.random.Generator
FORCE = "drive_force_N"
ACCELS = ("mass_accel_mps2", "base_accel_mps2")


def _gain(signals: Signals, s: float, n: Numbers) -> None:
    signals[FORCE] *= 1.0 + s * n["error"]


def _bias(signals: Signals, s: float, n: Numbers) -> None:
    signals[FORCE] += s * n["bias_N"]


def _drift_creep(signals: Signals, s: float, n: Numbers) -> None:
    signals[FORCE] += s * n["drift_N"] * (1.0 - np.exp(-signals["t_s"] / n["time_s"]))


def _drift_power(signals: Signals, s: float, n: Numbers) -> None:
    signals[FORCE] += s * n["drift_N"] * (signals["t_s"] / 10.0) ** n["exponent"]


def _low_pass(signals: Signals, s: float, n: Numbers) -> None:
    """A filter of unit gain whose corner is in proportion to 1 / strength; it has settled before the run begins."""
    corner_Hz = n["corner_Hz"] / s
    if corner_Hz > 0.4 * SAMPLE_RATE_HZ:  # above the range of 20 kHz sampling: a first-order mix that vanishes with s
        share = 0.4 * SAMPLE_RATE_HZ / corner_Hz
        signals[FORCE][1:] -= 0.5 * share * np.diff(signals[FORCE])
        return
    b, a = bessel(int(n["order"]), 2.0 * np.pi * corner_Hz, analog=True, norm="mag")
    b, a = bilinear(b, a, SAMPLE_RATE_HZ)
    first = signals[FORCE][0]
    signals[FORCE] = lfilter(b, a, signals[FORCE] - first) + first


def _delay(signals: Signals, s: float, n: Numbers) -> None:
    signals[FORCE] = np.interp(signals["t_s"] - s * n["delay_s"], signals["t_s"], signals[FORCE])


def _accel_gain(signals: Signals, s: float, n: Numbers) -> None:
    for column in ACCELS:
        signals[column] *= 1.0 + s * n[column]


def _draw_accel_gain(random: Random) -> dict[str, float]:
    error = either(random) * random.uniform(0.15, 0.3)
    which = random.choice(3)  # mass, base or both
    return {ACCELS[0]: error * (which != 1), ACCELS[1]: error * (which != 0)}


FORMULAS = (
    Formula("force-sensor-gain", "linear", lambda r: {"error": either(r) * r.uniform(0.15, 0.25)}, sense=_gain),
    Formula("force-sensor-bias", "constant", lambda r: {"bias_N": either(r) * r.uniform(1.0, 2.0)}, sense=_bias),
    Formula(
        "force-sensor-drift",
        "settling",
        lambda r: {"drift_N": either(r) * r.uniform(1.0, 2.0), "time_s": r.uniform(3.0, 8.0)},
        sense=_drift_creep,
    ),
    Formula(
        "force-sensor-drift",
        "power",
        lambda r: {"drift_N": either(r) * r.uniform(1.0, 2.0), "exponent": r.uniform(0.7, 1.3)},
        sense=_drift_power,
    ),
    # amplifiers of strain gauges have switchable Bessel filters from 10 Hz up
    Formula(
        "force-sensor-lag",
        "bessel",
        lambda r: {"corner_Hz": r.uniform(20.0, 60.0), "order": float(r.integers(1, 4))},
        sense=_low_pass,
    ),
    Formula("force-sensor-delay", "dead-time", lambda r: {"delay_s": r.uniform(2e-3, 5e-3)}, sense=_delay),
    Formula("accelerometer-gain", "mass-base-or-both", _draw_accel_gain, sense=_accel_gain),
)
