"""The noise of a run, taken from the run: measured pieces of the part faster than 20 ms where the slide sticks.

The pieces keep hum, colour and quantisation, so no spectrum is assumed. Slower noise cannot be separated from motion; it is
drawn as a small drift of the force. An accelerometer shows no motion where the slide sticks: all of its signal is noise there.
"""

from typing import NamedTuple

import numpy as np
from scipy.ndimage import maximum_filter1d, uniform_filter1d
from scipy.signal import savgol_coeffs, savgol_filter

from bridge.arrays import Floats
from diagnosis.features.feature import Scales, Signals
from diagnosis.features.segments import CommandedRun

_WINDOW = 21  # blocks of the mean that is subtracted. Too small: noise is lost; too large: motion counts as noise
_FEWEST = 500  # fewest blocks of a piece; a shorter piece would repeat too often within a run
_FEWEST_STILL = 100  # fewest blocks of a piece of acceleration: a short piece is better than remains of a vibration
# Drift of the force sensor in a replicate, as a share of the static friction: 5 mN on the paper's rig, the drift of a strain
# gauge within 10 s. Too small: a good sensor's drift is a gap; too large: small effects on the level of the force are hidden.
SLOW_SHARE = 3e-4
_SLOW_WAVES = 6  # number of half waves over a run in the drift
_POSITION_WINDOW, _FORCE_WINDOW = 41, 5  # blocks of the cubic that is subtracted, with a force drive


class RunNoise(NamedTuple):
    """The noise of one run."""

    pieces: dict[str, Floats]  # stretch of measured noise by signal, [blocks of the piece]
    shake_mps2: dict[str, float]  # rms of an accelerometer without a vibration, by shake signal
    slow_force_N: float  # rms of the force sensor's drift

    def drawn(self, name: str, blocks: int, random: np.random.Generator) -> Floats:
        """A random stretch of noise of the signal `name`, [blocks], in the unit of the signal."""
        piece = self.pieces[name]
        offset = int(random.integers(len(piece)))
        result = np.tile(piece, blocks // len(piece) + 2)[offset : offset + blocks]
        if name == "drive_force_N":
            time = np.linspace(0.0, np.pi, blocks)
            weights = random.normal(size=_SLOW_WAVES) * self.slow_force_N / np.sqrt(_SLOW_WAVES)
            slow = np.cos(np.outer(time, np.arange(1, _SLOW_WAVES + 1))) @ weights
            result = result + slow
        elif name.endswith("accel_mps2"):  # the mean of the piece is noise slower than the piece: its sign is unknown
            result = result * (1.0 if random.random() < 0.5 else -1.0)
        return result


def noise_of(signals: Signals, commands: CommandedRun, scales: Scales) -> RunNoise:
    """The noise of a reduced run; `signals` [blocks] each."""
    if commands.motion is not None:
        return _axis_noise(signals, scales)
    leading = signals.get("drive_force_N", signals.get("mass_accel_mps2"))
    assert leading is not None, "evidence without force and acceleration is refused when it is read"  # noqa: S101
    speed = np.abs(leading - uniform_filter1d(leading, _WINDOW))
    # a slip is far above the noise; blocks within three slip durations of it are left out
    busy = speed > 6.0 * np.median(speed)
    reach = max(int(3.0 * scales.slip_s * 1e3), _WINDOW)
    quiet = np.logical_not(np.asarray(maximum_filter1d(busy, 2 * reach + 1)))
    if quiet.sum() < _FEWEST:
        quiet = speed <= np.quantile(speed, 0.3)
    pieces: dict[str, Floats] = {}
    shake: dict[str, float] = {}
    quiet[:_WINDOW] = quiet[-_WINDOW:] = False  # at the ends the mean is one-sided, and a ramp would leave spikes
    still = quiet & (commands.frequency_Hz == 0.0)
    for name, values in signals.items():
        rest = (values - uniform_filter1d(values, _WINDOW))[quiet]
        if name.endswith("shake_mps2"):
            shake[name] = float(np.median(values[still])) if still.any() else 0.0
            pieces[name] = rest
        elif name.endswith("accel_mps2") and still.sum() >= _FEWEST_STILL:
            pieces[name] = values[still]
        else:
            pieces[name] = rest * (_WINDOW / (_WINDOW - 1.0)) ** 0.5
    return RunNoise(pieces, shake, SLOW_SHARE * scales.force_N)


def _axis_noise(signals: Signals, scales: Scales) -> RunNoise:
    """Noise with a force drive, where the slide rarely rests: the remainder of a cubic, without ends and reversals.

    Position noise is the part above 12 Hz, which includes mains hum and which the measured force does not explain. The force is
    an input and may move in any way, so only its fastest part is noise; slower noise of the force does not move the mass.
    """
    pieces: dict[str, Floats] = {}
    for name, values in signals.items():
        window = _FORCE_WINDOW if name == "drive_force_N" else _POSITION_WINDOW
        # the cubic follows white noise by the weight of its middle sample; this factor restores the size of the remainder
        scale = (1.0 - float(np.asarray(savgol_coeffs(window, 3))[window // 2])) ** -0.5
        rest = scale * (values - np.asarray(savgol_filter(values, window, 3)))
        size = uniform_filter1d(np.abs(rest), _POSITION_WINDOW)
        calm = size <= 2.0 * np.median(size)
        calm[:_POSITION_WINDOW] = calm[-_POSITION_WINDOW:] = False
        pieces[name] = rest[calm] if calm.sum() >= _FEWEST else rest
    shake = {name: float(np.median(values)) for name, values in signals.items() if name.endswith("shake_mps2")}
    return RunNoise(pieces, shake, SLOW_SHARE * scales.force_N)
