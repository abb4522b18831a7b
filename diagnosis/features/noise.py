"""The noise of a run, taken from the run: what is faster than 20 ms where the slide sticks, in pieces as they were measured.

So hum, colour and quantisation come along as they are; no spectrum has to be assumed. Slower noise cannot be told from motion
and is drawn as a small drift of the force. An acceleration has no motion to be told from where the slide sticks: all of it is
noise, slow or fast.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.ndimage import maximum_filter1d, uniform_filter1d
from scipy.signal import savgol_coeffs, savgol_filter

from diagnosis.features.feature import Scales, Signals
from diagnosis.features.segments import Commands

Floats = npt.NDArray[np.floating[Any]]
_WINDOW = 21  # blocks
_FEWEST = 500  # blocks of a piece
_FEWEST_STILL = 100  # of an acceleration: better short than with what a vibration leaves in it
_SLOW_SHARE = 3e-4  # of the static friction: 5 mN on the paper's rig, the drift of a strain gauge within 10 s
_SLOW_WAVES = 6
_POSITION_WINDOW, _FORCE_WINDOW = 41, 5  # blocks


class Noise(NamedTuple):
    """By signal: pieces of measured noise; and what an accelerometer shakes by without being shaken."""

    pieces: dict[str, Floats]
    shake_mps2: dict[str, float]
    slow_force_N: float

    def drawn(self, name: str, blocks: int, random: np.random.Generator) -> Floats:
        """A stretch of noise, [blocks]."""
        piece = self.pieces[name]
        offset = int(random.integers(len(piece)))
        result = np.tile(piece, blocks // len(piece) + 2)[offset : offset + blocks]
        if name == "drive_force_N":
            time = np.linspace(0.0, np.pi, blocks)
            weights = random.normal(size=_SLOW_WAVES) * self.slow_force_N / np.sqrt(_SLOW_WAVES)
            slow = np.cos(np.outer(time, np.arange(1, _SLOW_WAVES + 1))) @ weights
            result = result + slow
        elif name.endswith("accel_mps2"):  # what is slower than the piece is known in size, not in sign
            result = result * (1.0 if random.random() < 0.5 else -1.0)
        return result


def noise_of(signals: Signals, commands: Commands, scales: Scales) -> Noise:
    """The noise of a reduced run."""
    if commands.motion is not None:
        return _axis_noise(signals, scales)
    leading = signals.get("drive_force_N", signals.get("mass_accel_mps2"))
    assert leading is not None, "evidence without force and acceleration is refused when it is read"  # noqa: S101
    speed = np.abs(leading - uniform_filter1d(leading, _WINDOW))
    # a slip stands far above the noise; keep three half periods away from it
    busy = speed > 6.0 * np.median(speed)
    reach = max(int(3.0 * scales.slip_s * 1e3), _WINDOW)
    quiet = np.logical_not(np.asarray(maximum_filter1d(busy, 2 * reach + 1)))
    if quiet.sum() < _FEWEST:
        quiet = speed <= np.quantile(speed, 0.3)
    pieces: dict[str, Floats] = {}
    shake: dict[str, float] = {}
    quiet[:_WINDOW] = quiet[-_WINDOW:] = False  # at the ends the mean is one-sided: a ramp would leave spikes
    still = quiet & (commands.frequency_Hz == 0.0)
    for name, values in signals.items():
        if name.endswith("shake_mps2"):
            calm = values[still] if still.any() else np.zeros(1)
            shake[name] = float(np.median(calm))
            spread = values - uniform_filter1d(values, _WINDOW)
            pieces[name] = spread[quiet]
        elif name.endswith("accel_mps2") and still.sum() >= _FEWEST_STILL:
            pieces[name] = values[still]
        else:
            rest = values - uniform_filter1d(values, _WINDOW)
            pieces[name] = rest[quiet] * (_WINDOW / (_WINDOW - 1.0)) ** 0.5
    return Noise(pieces, shake, _SLOW_SHARE * scales.force_N)


def _axis_noise(signals: Signals, scales: Scales) -> Noise:
    """With a force drive the slide hardly ever rests: what a cubic leaves, without the ends and the reversals.

    Of the position, what the measured force does not explain, 12 Hz and above: mains hum is to stay in it. Of the force, which
    is an input and moves as it likes, the fastest part only; what it lacks does not move the mass.
    """
    pieces: dict[str, Floats] = {}
    for name, values in signals.items():
        window = _FORCE_WINDOW if name == "drive_force_N" else _POSITION_WINDOW
        # of white noise the cubic takes the weight of the value itself
        scale = (1.0 - float(np.asarray(savgol_coeffs(window, 3))[window // 2])) ** -0.5
        rest = scale * (values - np.asarray(savgol_filter(values, window, 3)))
        size = uniform_filter1d(np.abs(rest), _POSITION_WINDOW)
        calm = size <= 2.0 * np.median(size)
        calm[:_POSITION_WINDOW] = calm[-_POSITION_WINDOW:] = False
        pieces[name] = rest[calm] if calm.sum() >= _FEWEST else rest
    shake = {name: float(np.median(values)) for name, values in signals.items() if name.endswith("shake_mps2")}
    return Noise(pieces, shake, _SLOW_SHARE * scales.force_N)
