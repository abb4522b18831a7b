"""Inputs of the trees: numbers of the runs on the 1 ms grid, in the same order for every rig of one campaign.

A window is a stretch between changes of command, so measured and simulated rigs have the same windows.
"""

import math
from itertools import pairwise

import numpy as np
from scipy.ndimage import maximum_filter1d
from scipy.signal import savgol_filter

from bridge.arrays import Floats
from diagnosis.evidence.manifest import RigTable
from diagnosis.features.feature import Features, Signals
from diagnosis.features.grid import BLOCK_S
from diagnosis.features.segments import CommandedRun

_SHARES = (0.03, 0.06, 0.12, 0.25, 0.5)  # lengths of waves, of the travel
_PERIODS_S = (0.1, 0.25, 0.6, 1.5, 4.0)
# Blocks left out at the end of a window, which is known to 0.1 s. 0: the drive's ramp passed for an uneven drive.
_EDGE = 100
# Share of the static friction that an uneven drive pulls with before it counts. 0: the wander of a displacement sensor, which
# simulated rigs lack, passed for an uneven drive in 14 of 18 cases.
_LEAST_PULL = 5e-4


def features_of(rig: RigTable, commands: CommandedRun, signals: Signals) -> Features:
    """All numbers of one run; NaN where this run has no such number."""
    result = Features()
    force, k = signals["drive_force_N"], rig.drive_stiffness_N_per_m
    drive = signals.get("drive_position_m", np.cumsum(commands.drive) * BLOCK_S)
    place = signals.get("mass_position_m", drive - force / (k or 1.0))
    window = 2 * max(round(math.pi * math.sqrt(rig.mass_kg / k) / BLOCK_S / 8) if k else 5, 2) + 1
    speed, bend = (np.asarray(savgol_filter(place, window, 3, deriv=order, delta=BLOCK_S)) for order in (1, 2))
    accel = signals.get("mass_accel_mps2", bend)
    t_s = np.arange(len(force)) * BLOCK_S
    for number, segment in enumerate(commands.segments):
        at = slice(segment.first, segment.last - _EDGE)
        groups: dict[str, list[float]] = {}
        if k and "mass_position_m" in signals:
            stretch = drive[at] - place[at]
            rate = np.gradient(np.convolve(stretch, np.full(5, 0.2), mode="same"), BLOCK_S)
            columns = [stretch, rate, np.gradient(rate, BLOCK_S), stretch**3, np.abs(stretch - stretch.mean()), t_s[at]]
            groups["spring"] = _lines((force[at] - k * stretch) / rig.coulomb_force_N, columns)
        if k and "drive_position_m" in signals:
            uneven = _straightened(drive[at], t_s[at]) * k / rig.static_force_N
            values = [float(uneven.std()), *(_wave(uneven, turns) for turns in _turns(drive[at]))]
            groups["drive"] = np.log(np.array(values) + _LEAST_PULL).tolist()
        if segment.frequency_Hz > 0.0:
            commanded = segment.amplitude_m * (2.0 * np.pi * segment.frequency_Hz) ** 2 / math.sqrt(2.0)
            for name in {"base_shake_mps2", "mass_shake_mps2"} & signals.keys():
                shake, load = signals[name][at] / commanded, np.abs(force[at])
                third = len(shake) // 3
                along = float(np.polyfit(load, shake, 1)[0]) if np.ptp(load) > 0.0 else 0.0
                later = float(shake[-third:].mean() - shake[:third].mean())
                groups[name] = [float(shake.mean()), later, along]
        else:
            if {"mass_accel_mps2", "mass_position_m"} <= signals.keys():
                columns = [bend[at], np.gradient(bend[at], BLOCK_S), speed[at]]
                groups["motion"] = _lines(np.asarray(savgol_filter(accel[at], window, 3)) - bend[at], columns)
            if "base_accel_mps2" in signals:
                base, fast = signals["base_accel_mps2"][at], np.abs(speed[at])
                near = np.asarray(maximum_filter1d(fast > 0.2 * np.quantile(fast, 0.99), 101), np.bool_)
                both = near.any() and not near.all()
                groups["base"] = [math.log(base[near].std() / base[~near].std()) if both else math.nan]
        pulled = (force[at] - rig.mass_kg * accel[at]) / rig.coulomb_force_N
        groups["friction"] = _friction(pulled, [speed[at], accel[at], t_s[at], place[at]], rig.stribeck_velocity_mps)
        drop = 0.35 * (rig.static_force_N / rig.coulomb_force_N - 1.0)
        groups["force"] = _levels(force[at] / rig.coulomb_force_N, place[at], t_s[at], drop)
        for kind, values in sorted(groups.items()):
            names = [(f"{kind} {i}", "") for i in range(len(values))]
            result.add_all(names, "", (0.0, 0.0), number, values)
    return result


def _lines(y: Floats, columns: list[Floats]) -> list[float]:
    """Sizes of the columns as standard deviations of their parts, and the logarithm of the remainder."""
    design = np.stack(columns, axis=1)[::2]
    y = y[::2] - y[::2].mean()
    design = (design - design.mean(axis=0)) / (design.std(axis=0) + 1e-300)
    sizes = np.linalg.solve(design.T @ design + 1e-6 * len(y) * np.eye(len(columns)), design.T @ y)
    return [*sizes.tolist(), float(np.log((y - design @ sizes).std() + 1e-12))]


def _friction(pulled: Floats, courses: list[Floats], stribeck_mps: float) -> list[float]:
    """Sliding friction, each way: its level by speed, and its course with speed, acceleration, time and place."""
    values: list[float] = []
    swift = float(np.quantile(np.abs(courses[0]), 0.98))
    for side in (1.0, -1.0):
        moves = side * courses[0] > stribeck_mps
        if np.count_nonzero(moves) < 60:
            values += [math.nan] * 10
            continue
        v, y = side * courses[0][moves], side * pulled[moves]
        for low, high in pairwise((stribeck_mps, 2.0 * stribeck_mps, 0.3 * swift, 0.6 * swift, math.inf)):
            inside = (v >= low) & (v < high)
            values.append(float(y[inside].mean()) if np.count_nonzero(inside) > 10 else math.nan)
        values += [*_lines(y, [v, *(side * course[moves] for course in courses[1:])]), float(y.std())]
    return values


def _levels(force: Floats, place: Floats, t_s: Floats, drop: float) -> list[float]:
    """Mean and scatter of the force, its highest and lowest values around the slips, and their course over place and time."""
    size = force if force.mean() >= 0.0 else -force
    highs, lows = turning_points(size, drop)
    values = [float(force.mean()), float(force.std()), float(len(highs)), float(size.max()), float(size.min())]
    for points in (highs, lows):
        if len(points) < 4:
            values += [math.nan] * (6 + len(_SHARES) + len(_PERIODS_S))
            continue
        level, at = size[points], t_s[points]
        waits, about = np.diff(at), _straightened(level, at)
        again = float(np.corrcoef(level[:-1], level[1:])[0, 1]) if level.std() > 0.0 else 0.0
        values += [float(level[1:].mean()), float(level.std()), float(np.polyfit(at, level, 1)[0] * np.ptp(t_s))]
        values += [float(waits.mean()), float(waits.std()), again]
        values += [_wave(about, turns) for turns in (*_turns(place[points]), *(at / period for period in _PERIODS_S))]
    return values


def turning_points(level: Floats, drop: float) -> tuple[list[int], list[int]]:
    """Where the force is highest before it falls by `drop`, and lowest before it rises by half of that."""
    highs: list[int] = []
    lows: list[int] = []
    high = low = 0
    climbing = True
    size = level.tolist()  # faster, element by element
    for i in range(0, len(size), 2):
        if climbing:
            high = i if size[i] > size[high] else high
            if size[high] - size[i] > drop:
                highs.append(high)
                climbing, low = False, i
        else:
            low = i if size[i] < size[low] else low
            if size[i] - size[low] > 0.5 * drop:
                lows.append(low)
                climbing, high = True, i
    return highs, lows


def _straightened(values: Floats, over: Floats) -> Floats:
    return values - np.polyval(np.polyfit(over - over.mean(), values, 1), over - over.mean())


def _turns(place: Floats) -> list[Floats]:
    return [place / max(share * float(np.ptp(place)), 1e-12) for share in _SHARES]


def _wave(values: Floats, turns: Floats) -> float:
    """Amplitude of the sine over `turns`."""
    return float(2.0 * abs(np.mean(values * np.exp(-2j * np.pi * turns))))
