"""Candidate waves on a force-driven axis: lines in the friction, relative to its mean at that speed and direction.

They are only starting points of a refit, never a verdict.
"""

import numpy as np
from scipy.ndimage import uniform_filter1d

from diagnosis.features.force_drive import friction_share
from diagnosis.features.grid import BLOCK_S
from diagnosis.gap.prepare import Prepared
from diagnosis.hypotheses.waves import Wave, WaveSeries, fitted, wave_of

_EVERY = 8  # blocks for each sample
_MOST_TURNS = 200  # most turns of a wave within the longest run
_STEPS_PER_TURN = 3  # tried periods for each turn: a line is one turn wide


def axis_waves(runs: list[Prepared], over: str, most: int) -> list[Wave]:
    """The strongest waves of the friction over `position` [m] or `time` [s], strongest first."""
    series: list[WaveSeries] = []
    for run in runs:
        motion = run.commands.motion
        if motion is None:
            continue
        share, valid = friction_share(run.signals["drive_force_N"], motion)
        time_s = np.arange(len(share)) * BLOCK_S
        at = motion.position_m if over == "position" else time_s
        series.append(WaveSeries(at[valid][::_EVERY], uniform_filter1d(share, _EVERY)[valid][::_EVERY]))
    span = max((float(np.ptp(part.at)) for part in series), default=0.0)
    if span <= 0.0:
        return []
    periods = span * _STEPS_PER_TURN / np.arange(1, _MOST_TURNS * _STEPS_PER_TURN)
    power, shares = fitted(series, periods)
    near = 2 * _STEPS_PER_TURN
    peaks = [i for i in range(len(power)) if power[i] == power[max(0, i - near) : i + near + 1].max()]
    best = [wave_of(float(periods[i]), shares[i]) for i in sorted(peaks, key=lambda i: -power[i])[:most]]
    return [wave._replace(spread=min(0.5 * wave.period / span, 0.2)) for wave in best]
