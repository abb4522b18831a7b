"""Sensors of a prediction: the sensor effects of the library, and small lags that no manifest states.

The plant's kernel applies the same effects to each sample. Here they are applied to blocks of 1 ms after the kernel, so a trial
of a sensor effect needs no simulation. A slip lasts tens of blocks, so the blocks resolve a lag far below 1 ms.
"""

import math
from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter

from bridge.arrays import Floats
from diagnosis.features.feature import BOW
from diagnosis.features.grid import BLOCK_S
from diagnosis.features.segments import CommandedRun
from diagnosis.model.rig import Effects
from plant.effects.library import EFFECTS
from plant.effects.sensors import LAG_ORDERS

Signals = dict[str, Floats]
SENSOR_EFFECTS = tuple(name for name, effect in EFFECTS.items() if effect.acts_on == "sensor")
# Mean and standard deviation of sensor numbers that no manifest states, by field of `SensorChain`. A 2 kHz force channel lags by
# 80 us, an 800 Hz displacement channel by 200 us, an unfiltered channel by 0; displacement sensors are linear to 0.2 % of their
# range: up to 0.8 % in slope; common accelerometers begin at 0 to 0.5 Hz and end at 10 kHz or above.
ORDINARY = {
    "force_delay_s": (4e-5, 4e-5),
    "position_delay_s": (1e-4, 1e-4),
    "position_scale": (1.0, 0.004),
    "drive_slope": (0.0, 0.006),
    "drive_bow_per_m": (0.0, 2.0 * BOW),  # over the travel: 0.2 %, the linearity above
    "accel_lowest_Hz": (0.25, 0.25),
    "accel_rolled_off": (0.5, 0.5),
}
ACCEL_GAIN = 0.01  # relative standard deviation of an ordinary accelerometer's gain, and of its cross sensitivity
# Bend of the force over the extension, and of an acceleration over a displacement, that the low-passes of two sensors make.
# Smaller: rigs without a gap show a bend. Larger: a slow and a delayed force sensor are not separated. Counted on 20 rigs without
# a gap (docs/method/diagnosis.md).
BEND_S2 = 1e-7
# Standard deviation of the smoothing of the rate that inverts a low-pass. Too small: noise; too large: smeared reversals.
_DERIVATIVE_S = 2e-3


class SensorChain(NamedTuple):
    """Small deviations of an ordinary measuring chain; a manifest does not state them."""

    force_delay_s: float = 0.0
    position_delay_s: float = 0.0
    position_scale: float = 1.0
    drive_slope: float = 0.0  # relative error of the drive's displacement sensor against the slide's, at position 0
    drive_bow_per_m: float = 0.0  # change of `drive_slope` along the track
    accel_lowest_Hz: float = 0.0  # corner of the high-pass of a piezoelectric accelerometer
    accel_rolled_off: float = 0.0  # the accelerometer's gain is 1 / sqrt(1 + accel_rolled_off (f / 10 kHz)^2)


def sensed(signals: Signals, frequency_Hz: Floats, effects: Effects, chain: SensorChain) -> Signals:
    """Predicted signals behind a measuring chain with sensor effects; new arrays, [blocks] each.

    Args:
        signals: all of the grid's signals, [blocks] each.
        frequency_Hz: frequency of the commanded vibration, [blocks].
        effects: effects of the model; only sensor effects are applied.
        chain: the measuring chain.

    """
    result = dict(signals)
    force_N = result["drive_force_N"]
    t_s = (np.arange(len(force_N)) + 0.5) * BLOCK_S
    delay_s = chain.force_delay_s
    for name in SENSOR_EFFECTS:
        if name not in effects:
            continue
        form = effects[name]["form"]
        value = {key: float(number) for key, number in effects[name].items() if key != "form"}
        if name == "force-sensor-lag":
            for _ in range(LAG_ORDERS[str(form)]):
                force_N = low_pass(force_N, value["lag_s"])
        elif name == "force-sensor-delay":
            delay_s += value["delay_s"]
        elif name == "accelerometer-gain":
            for which in ("mass", "base") if form == "both" else (str(form),):
                for signal in (f"{which}_accel_mps2", f"{which}_shake_mps2"):
                    result[signal] = result[signal] * (1.0 + value["ratio"])
    force_N = delayed(force_N, delay_s)
    result["drive_force_N"] = force_N * _force_gain(effects) + _force_offset_N(effects, t_s)
    if chain.accel_lowest_Hz > 0.0:
        memory_s = 0.5 / (np.pi * chain.accel_lowest_Hz)
        for name in ("mass_accel_mps2", "base_accel_mps2"):
            result[name] = result[name] - low_pass(result[name], memory_s)
    gain = 1.0 / np.sqrt(1.0 + chain.accel_rolled_off * (frequency_Hz / 1e4) ** 2)
    for name in ("mass_shake_mps2", "base_shake_mps2"):
        result[name] = result[name] * gain
    for name in ("mass_position_m", "drive_position_m"):
        result[name] = chain.position_scale * delayed(result[name], chain.position_delay_s)
    drive_m = result["drive_position_m"]
    result["drive_position_m"] = drive_m + drive_m * (chain.drive_slope + chain.drive_bow_per_m * drive_m)
    return result


def true_force_N(reading_N: Floats, effects: Effects, t_s: Floats) -> Floats:
    """True force [N] for the readings `reading_N` at the times `t_s`, all of one shape; without lags and delays."""
    return (reading_N - _force_offset_N(effects, t_s)) / _force_gain(effects)


def _force_gain(effects: Effects) -> float:
    return 1.0 + float(effects.get("force-sensor-gain", {}).get("ratio", 0.0))


def _force_offset_N(effects: Effects, t_s: Floats) -> Floats:
    """Bias and drift [N] of the force sensor at the times `t_s`, same shape."""
    offset_N = np.full_like(t_s, float(effects.get("force-sensor-bias", {}).get("bias_N", 0.0)))
    if "force-sensor-drift" in effects:
        table = effects["force-sensor-drift"]
        if table["form"] == "linear":
            offset_N = offset_N + float(table["rate_N_per_s"]) * t_s
        else:
            offset_N = offset_N + float(table["drift_N"]) * (1.0 - np.exp(-t_s / float(table["settling_s"])))
    return offset_N


def delayed(values: Floats, delay_s: float) -> Floats:
    """`values` [blocks], delayed by `delay_s` (of any sign): a cubic through four blocks; constant beyond the ends.

    Linear interpolation would also smooth, as a slow sensor does: by up to 0.125 ms2 of `spring bend`. A delay and two equal
    low-passes with a total of 1 ms differ by only 0.25 ms2.
    """
    if delay_s == 0.0:
        return values
    shift = math.floor(delay_s / BLOCK_S)
    f = delay_s / BLOCK_S - shift
    later, earlier = max(shift + 2, 0), max(1 - shift, 0)
    padded = np.concatenate([np.full(later, values[0]), values, np.full(earlier, values[-1])])
    weights = (
        -f * (f - 1.0) * (f - 2.0) / 6.0,
        (f + 1.0) * (f - 1.0) * (f - 2.0) / 2.0,
        -(f + 1.0) * f * (f - 2.0) / 2.0,
        (f + 1.0) * f * (f - 1.0) / 6.0,
    )
    starts = range(later - shift + 1, later - shift - 3, -1)
    terms = (weight * padded[start : start + len(values)] for weight, start in zip(weights, starts, strict=True))
    return sum(terms, np.zeros(len(values)))


def low_pass(values: Floats, lag_s: float) -> Floats:
    """First-order low-pass of `values` [blocks] by the trapezoidal rule, which is exact up to the second derivative.

    A low-pass that is exact for straight lines between blocks would smooth by another 0.08 ms2 of `spring bend`.
    """
    if lag_s < 1e-9:
        return values
    turns = 2.0 * lag_s / BLOCK_S
    now, keep = 1.0 / (1.0 + turns), (turns - 1.0) / (turns + 1.0)
    # the filter starts at rest on the first value
    result, _ = lfilter([now, now], [1.0, -keep], values, zi=np.array([values[0] * (1.0 - now)]))
    return np.asarray(result)


def relative(chain: SensorChain) -> SensorChain:
    """The chain with all delays relative to the position sensor: along a measured motion only their difference shows."""
    return chain._replace(force_delay_s=chain.force_delay_s - chain.position_delay_s, position_delay_s=0.0)


def true_commands(commands: CommandedRun, effects: Effects, chain: SensorChain) -> CommandedRun:
    """The commands of a force-driven run with the true force [N] and the true motion: the inverse of `sensed`.

    `chain` is from `relative`.
    """
    motion = commands.motion
    assert motion is not None, "a force drive has a motion"  # noqa: S101
    motion = motion._replace(position_m=motion.position_m / chain.position_scale)
    return commands._replace(drive=_true_force(commands.drive, effects, chain), motion=motion)


def _true_force(force_N: Floats, effects: Effects, chain: SensorChain) -> Floats:
    force_N = true_force_N(force_N, effects, (np.arange(len(force_N)) + 0.5) * BLOCK_S)
    delay_s = chain.force_delay_s
    if "force-sensor-delay" in effects:
        delay_s += float(effects["force-sensor-delay"]["delay_s"])
    force_N = delayed(force_N, -delay_s)
    if "force-sensor-lag" in effects:
        table = effects["force-sensor-lag"]
        for _ in range(1 if table["form"] == "first-order" else 2):
            rate = gaussian_filter1d(force_N, _DERIVATIVE_S / BLOCK_S, order=1) / BLOCK_S
            force_N = force_N + float(table["lag_s"]) * rate
    return force_N
