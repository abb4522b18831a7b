"""The runs of a campaign: how the drive moves, and when the base is vibrated."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from tests.blind.workshop.rigs import Kind

_RAMP_S = 0.03  # the exciter's amplitude goes up and down within this time


class Run(NamedTuple):
    """One run; points are linear in between."""

    drive: tuple[tuple[float, float], ...]  # (time [s], velocity [m/s])
    vibration: tuple[tuple[float, float, float, float], ...]  # (from [s], until [s], frequency [Hz], amplitude [m])
    duration_s: float
    held_out: bool
    begun_s: float  # since the bench was switched on
    start_m: float
    start_share: float  # force in the spring at the start, over the static force
    rested_s: float

    @property
    def velocity_mps(self) -> float | None:
        """The drive's velocity, if it is constant."""
        speeds = {speed for _, speed in self.drive}
        return speeds.pop() if len(speeds) == 1 else None

    def commands(self, t_s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Drive velocity [m/s], frequency [Hz] and amplitude [m] at the times `t_s`; frequency 0 without vibration."""
        frequency_Hz, amplitude_m = np.zeros_like(t_s), np.zeros_like(t_s)
        for from_s, until_s, Hz, height_m in self.vibration:
            corners_s = (from_s, from_s + _RAMP_S, until_s - _RAMP_S, until_s)
            height = np.interp(t_s, corners_s, (0.0, height_m, height_m, 0.0))
            amplitude_m += height
            frequency_Hz[height > 0.0] = Hz
        return np.interp(t_s, *np.array(self.drive).T), frequency_Hz, amplitude_m


def _levels(levels: list[float], duration_s: float, random: np.random.Generator) -> tuple[tuple[float, float], ...]:
    """Velocities one after the other for about equal times, each reached within 20 to 60 ms."""
    shares = random.uniform(0.7, 1.3, len(levels))
    ends_s = np.cumsum(shares / shares.sum() * duration_s)
    change_s = random.uniform(0.02, 0.06)
    points = [(0.0, levels[0])]
    for end_s, before, after in zip(ends_s, levels, levels[1:], strict=False):
        points += [(float(end_s), before), (float(end_s + change_s), after)]
    return tuple(points)


def _steady(speeds: tuple[float, float, float], _duration_s: float, random: np.random.Generator):
    return ((0.0, random.choice(speeds[:2]) * random.choice((1.0, 1.0, -1.0))),)


def _stairs(speeds: tuple[float, float, float], duration_s: float, random: np.random.Generator):
    return _levels(list(random.permutation(speeds)), duration_s, random)


def _turns(speeds: tuple[float, float, float], duration_s: float, random: np.random.Generator):
    first, second, third = random.permutation(speeds)
    return _levels([first, -second, -first, third], duration_s, random)


def _ramp(speeds: tuple[float, float, float], duration_s: float, random: np.random.Generator):
    """Hold slow, rise to fast, hold, and return."""
    at_s = duration_s * np.array([0.0, 0.25, 0.5, 0.75, 0.8]) * random.uniform(0.9, 1.05)
    return tuple(zip(at_s.tolist(), (speeds[0], speeds[0], speeds[2], speeds[2], -speeds[1]), strict=True))


def _stops(speeds: tuple[float, float, float], duration_s: float, random: np.random.Generator):
    """Drag and hold in turns."""
    go = speeds[1]
    return _levels([go, 0.0, go, 0.0, random.choice((go, -go))], duration_s, random)


_MOTIONS: tuple[Callable, ...] = (_steady, _stairs, _turns, _ramp, _stops)


def _tones(kind: Kind, duration_s: float, random: np.random.Generator) -> tuple[tuple[float, float, float, float], ...]:
    """Three to five tones in random order, after a time without vibration."""
    number = int(random.integers(3, 6))
    low_Hz, high_Hz = kind.vibration_Hz
    tones_Hz = random.permutation(np.round(np.linspace(low_Hz, high_Hz, number) * random.uniform(0.85, 1.0), -1))
    begin_s = random.uniform(1.0, 0.25 * duration_s)
    edges_s = np.linspace(begin_s, duration_s - random.uniform(0.2, 1.0), number + 1)
    pause_s = random.choice((0.05, 0.4))
    height_m = float(f"{kind.amplitude_m * random.uniform(0.6, 1.3):.2g}")
    return tuple(
        (float(a), float(b - pause_s), max(float(Hz), 500.0), height_m)
        for a, b, Hz in zip(edges_s, edges_s[1:], tones_Hz, strict=False)
    )


def draw_campaign(kind: Kind, random: np.random.Generator) -> tuple[Run, ...]:
    """Three to five runs: at least one with a turn, one with vibration to fit, and one or two that are held out."""
    number = int(random.integers(3, 6))
    held_out = 2 if number == 5 else 1
    motions = [_turns, _steady, *(_MOTIONS[random.integers(len(_MOTIONS))] for _ in range(number - held_out - 2))]
    vibrated = [False, True, *(random.random() < 0.3 for _ in motions[2:])]
    order = random.permutation(len(motions))
    plans = [(motions[i], vibrated[i], False) for i in order]
    plans += [((_turns, _stairs)[int(i)], i == 0 or random.random() < 0.5, True) for i in range(held_out)]
    begun_s, runs = 0.0, []
    for motion, vibrates, is_held_out in plans:
        duration_s = float(np.round(random.uniform(7.0 if vibrates else 6.0, 15.0), 1))
        speeds = tuple(speed * random.uniform(0.8, 1.2) for speed in kind.speeds_mps)
        drive = tuple((float(t_s), float(f"{mps:.2g}")) for t_s, mps in motion(speeds, duration_s, random))
        vibration = _tones(kind, duration_s, random) if vibrates else ()
        start_m = float(random.uniform(2.0, 12.0) * kind.speeds_mps[1])
        share, rested_s = random.uniform(-0.1, 0.6), random.uniform(0.5, 5.0)
        runs.append(Run(drive, vibration, duration_s, is_held_out, begun_s, start_m, share, rested_s))
        begun_s += duration_s + random.uniform(5.0, 40.0)
    return tuple(runs)
