"""Candidate waves, from breakaways, the level of sliding and the drive position; frequencies at which a structure rings.

They are only starting points of a refit, never a verdict.
"""

from collections.abc import Mapping
from itertools import combinations, pairwise
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import find_peaks, welch

from bridge.arrays import Floats
from diagnosis.features.feature import Scales
from diagnosis.features.force_drive import friction_share
from diagnosis.features.grid import BLOCK_S
from diagnosis.gap.prepare import Prepared
from diagnosis.model.per_run import PHASE, of_run
from diagnosis.slips import turning_points

_GRID = 1500  # number of periods that are tried for a wave
LOBES = 2  # peaks that are tried in each range: separate pieces of track leave the period ambiguous
_LOBE = 10  # least distance of two peaks, in grid points
MOST = 3  # pairs of waves that are tried, and waves of a force-driven axis, where strong waves are clear lines
_STEEPEST = 0.8  # largest second harmonic, relative to the first
_EVERY = 8  # blocks for each sample of a force-driven axis
_MOST_TURNS = 200  # most turns of a wave within the longest run
_STEPS_PER_TURN = 3  # tried periods for each turn: a line is one turn wide
_WINDOW = 512  # blocks of a window: a resolution of 2 Hz
# range of a ringing base: slips are slower, the 1 ms grid resolves no faster ringing
_LOWEST_HZ, _HIGHEST_HZ = 20.0, 450.0
_PROMINENCE = 2.0  # smallest prominence of a peak in the logarithm of power; combs of regular slips stay below


class Wave(NamedTuple):
    """ratio (sin a + second_sin sin 2a + second_cos cos 2a), a = 2 pi u / period + phase_rad, over a coordinate u."""

    period: float
    ratio: float
    phase_rad: float
    second_sin: float = 0.0
    second_cos: float = 0.0
    spread: float = 0.2  # relative standard deviation of the period
    # phases in the runs after the first; empty: one phase for all runs
    phases_of: Mapping[str, float] = MappingProxyType({})


class WaveSeries(NamedTuple):
    """A quantity along a coordinate; its mean is free."""

    at: Floats
    value: Floats  # deviation from the mean, relative
    weight: float = 1.0
    run: str = ""  # file of the run
    of_slips: bool = False  # whether there is one value for each breakaway; False: values of continuous motion


def waves_beside(series: list[WaveSeries], waves: list[Wave], at: tuple[float, ...]) -> list[Wave]:
    """Waves with harmonic and best phase; their periods are `at` spreads away from the periods of `waves`."""
    result: list[Wave] = []
    for wave in waves:
        periods = wave.period * (1.0 + wave.spread * np.array(at))
        _, shares = fitted(series, periods, 2)
        beside = zip(periods.tolist(), shares, strict=True)
        result += [wave_of(period, share)._replace(spread=wave.spread) for period, share in beside]
    return result


def two_waves(series: list[WaveSeries], most: int) -> list[tuple[Wave, Wave]]:
    """Pairs of the strongest waves, those that explain most together first."""
    together = [_fitted_pair(series, *two) for two in combinations(strongest_waves(series, most), 2)]
    together.sort(key=lambda pair: -pair[0])
    return [two for _, two in together[:MOST]]


def _fitted_pair(series: list[WaveSeries], first: Wave, second: Wave) -> tuple[float, tuple[Wave, Wave]]:
    """The part of the sum of squares that two waves explain together, and the two waves refitted."""
    columns: list[Floats] = []
    for part_of_run in series:
        turns = [2.0 * np.pi * part_of_run.at / wave.period for wave in (first, second)]
        columns_of_run = np.column_stack([part(angle) for angle in turns for part in (np.sin, np.cos)])
        columns.append(columns_of_run - columns_of_run.mean(axis=0))
    stacked, value = np.concatenate(columns), np.concatenate([part_of_run.value for part_of_run in series])
    shares = np.linalg.lstsq(stacked, value)[0]
    refitted = [
        wave_of(wave.period, share)._replace(spread=wave.spread)
        for wave, share in zip((first, second), (shares[:2], shares[2:]), strict=True)
    ]
    refitted.sort(key=lambda wave: -wave.ratio)
    return float(value @ (stacked @ shares)), (refitted[0], refitted[1])


def friction_series(runs: list[Prepared], scales: Scales, over: str) -> list[WaveSeries]:
    """Breakaways, or levels of sliding without slips, over `position` [m] or `time` [s]; a series for each segment."""
    series: list[WaveSeries] = []
    for run in runs:
        force = run.signals.get("drive_force_N")
        if force is None:
            continue
        blocks = np.arange(len(force))
        if over == "position":
            coordinate = run.signals.get("mass_position_m")
            if coordinate is None:
                path_m = np.cumsum(run.commands.drive) * BLOCK_S
                coordinate = run.start.position_m + path_m - (force - force[0]) / scales.stiffness_N_per_m
        else:
            coordinate = (blocks + 0.5) * BLOCK_S
        for segment in run.commands.segments:
            inside = slice(segment.first, segment.last)
            cut = segment.sign * force[inside]
            turned = turning_points(cut, scales.drop_N)
            at = turned[: len(turned) // 2 * 2 : 2]  # breakaways
            if len(at) >= 2:
                series.append(
                    WaveSeries(coordinate[inside][at], cut[at] / cut[at].mean() - 1.0, run=run.file, of_slips=True)
                )
            elif len(turned) == 0 and len(cut) > 500:
                # without slips the slide moves evenly after the first climb
                even = cut[len(cut) // 3 :]
                level = even[: len(even) // 20 * 20].reshape(-1, 20).mean(axis=1)
                if np.ptp(level) < 0.2 * scales.force_N and level.mean() > 0.5 * scales.force_N:
                    places = coordinate[inside][len(cut) // 3 + 10 :: 20][: len(level)]
                    series.append(WaveSeries(places, level / level.mean() - 1.0, run=run.file))
    return series


def drive_series(runs: list[Prepared], over: str) -> list[WaveSeries]:
    """The drive's velocity relative to its mean, over its `position` [m] or `time` [s]; a series for each segment."""
    series: list[WaveSeries] = []
    for run in runs:
        position = run.signals.get("drive_position_m")
        if position is None:
            continue
        for segment in run.commands.segments:
            path = position[segment.first : segment.last]
            kept = len(path) // 20 * 20
            if kept < 400 or segment.drive_velocity_mps == 0.0:
                continue
            mean = path[:kept].reshape(-1, 20).mean(axis=1)
            t_s = (segment.first + 10.0 + 20.0 * np.arange(len(mean))) * BLOCK_S
            slope = np.gradient(mean, 20 * BLOCK_S) / segment.drive_velocity_mps
            # the weight is the speed: the faster the drive, the less noise in its relative velocity
            speed_mm_per_s = 1e3 * abs(segment.drive_velocity_mps)
            series.append(
                WaveSeries(mean if over == "position" else t_s, slope / slope.mean() - 1.0, speed_mm_per_s, run.file)
            )
    return series


def waves_apart(series: list[WaveSeries], runs: list[Prepared], most: int) -> list[Wave]:
    """The strongest waves over time if each run may have another phase; empty unless two runs have a series."""
    by_run = {run.file: [part for part in series if part.run == run.file] for run in runs}
    if sum(bool(parts) for parts in by_run.values()) < 2:
        return []
    waves: list[Wave] = []
    for wave in strongest_waves(series, most, apart=True):
        first, *later = (
            wave_of(wave.period, fitted(parts, np.array([wave.period]))[1][0]) if parts else wave
            for parts in by_run.values()
        )
        ratio = float(np.sqrt(np.mean([in_run.ratio**2 for in_run in (first, *later)])))
        phases_of = {of_run(PHASE, run.file): in_run.phase_rad for run, in_run in zip(runs[1:], later, strict=True)}
        waves.append(wave._replace(ratio=ratio, phase_rad=first.phase_rad, phases_of=phases_of))
    return waves


def strongest_waves(series: list[WaveSeries], most: int, harmonics: int = 1, apart: bool = False) -> list[Wave]:
    """The strongest waves, two in each of `most` ranges of periods; with `apart`, each run may have another phase."""
    if not series:
        return []
    span = max(float(np.ptp(part.at)) for part in series)
    spacing = min(float(np.median(np.abs(np.diff(part.at)))) for part in series)
    if span <= 0.0 or spacing <= 0.0:
        return []
    reach = max(float(part.at.max()) for part in series) - min(float(part.at.min()) for part in series)
    # a wave of less than one turn is a drift
    periods = np.geomspace(max(0.3 * spacing, span / 100.0), min(2.0 * span, reach), _GRID)
    power, shares = fitted(series, periods, harmonics)
    if apart:
        runs = dict.fromkeys(part.run for part in series)
        power = np.sum([fitted([part for part in series if part.run == run], periods)[0] for run in runs], axis=0)
    # the best of each range of periods: short periods always fit the few breakaways best
    edges = np.linspace(0, _GRID, most + 1).astype(np.int64)
    best: list[int] = []
    for first, last in pairwise(edges.tolist()):
        peaks = [i for i in range(first, last) if power[i] == power[max(0, i - _LOBE) : i + _LOBE + 1].max()]
        best += sorted(peaks, key=lambda i: -power[i])[:LOBES]
    waves = [wave_of(float(periods[i]), shares[i]) for i in best if power[i] > 0.0]
    return [wave._replace(spread=min(0.5 * wave.period / reach, 0.2)) for wave in waves]


def fitted(series: list[WaveSeries], periods: Floats, harmonics: int = 1) -> tuple[Floats, Floats]:
    """Waves with `harmonics` harmonics, one fit for each period.

    Returns:
        The part of the sum of squares that each explains [periods], and its shares of sine and cosine [periods, 2 x harmonics].

    """
    normal = np.zeros((len(periods), 2 * harmonics, 2 * harmonics))
    right = np.zeros((len(periods), 2 * harmonics))
    for part in series:
        turns = 2.0 * np.pi * part.at / periods[:, None]
        columns = np.stack([wave(k * turns) for k in range(1, harmonics + 1) for wave in (np.sin, np.cos)], axis=2)
        columns = part.weight * (columns - columns.mean(axis=1, keepdims=True))
        normal += columns.transpose(0, 2, 1) @ columns
        right += part.weight * (part.value @ columns)
    held = 1e-9 * np.trace(normal, axis1=1, axis2=2)
    shares = np.linalg.solve(normal + held[:, None, None] * np.eye(2 * harmonics), right[..., None])[..., 0]
    return np.sum(right * shares, axis=1), shares


def wave_of(period: float, shares: Floats) -> Wave:
    """The wave of one period with its shares of sine and cosine [2 x harmonics]."""
    ratio, phase = float(np.hypot(*shares[:2])), float(np.arctan2(shares[1], shares[0]))
    wave = Wave(period, ratio, phase)
    if len(shares) == 4 and ratio > 0.0:
        turned = complex(*shares[2:]) * np.exp(-2j * phase) / ratio
        second = np.clip((turned.real, turned.imag), -_STEEPEST, _STEEPEST).tolist()
        wave = wave._replace(second_sin=second[0], second_cos=second[1])
    return wave


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


def ringing_Hz(runs: list[Prepared], signal: str, most: int) -> list[float]:
    """Frequencies of the most prominent peaks, `most` at most; empty without the signal."""
    power: Floats = np.zeros(_WINDOW // 2 + 1)
    frequency_Hz = np.fft.rfftfreq(_WINDOW, BLOCK_S)
    for run in runs:
        for segment in run.commands.segments:
            values = run.signals.get(signal, np.zeros(0))[segment.first : segment.last]
            if segment.frequency_Hz == 0.0 and len(values) >= _WINDOW:
                power += len(values) * welch(values, 1.0 / BLOCK_S, nperseg=_WINDOW)[1]
    inside = (frequency_Hz > _LOWEST_HZ) & (frequency_Hz < _HIGHEST_HZ)
    peaks, properties = find_peaks(np.log(np.maximum(power[inside], 1e-300)), prominence=_PROMINENCE)
    order = np.argsort(-properties["prominences"])[:most]
    return [float(value) for value in frequency_Hz[inside][peaks[order]]]
