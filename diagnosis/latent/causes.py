"""The causes that a level of friction may depend on, each with the courses that it can take over the rows.

A course is a column, or a wave: a cosine and a sine of one frequency over the place or the time. Waves are searched by a Fourier
transform of the remainder, so all frequencies are tried at the cost of one.
"""

import math
from typing import NamedTuple

import numpy as np
from scipy.stats import rankdata

from bridge.arrays import Floats, Indices
from diagnosis.latent.rows import ExcessRows
from diagnosis.relations.relation import SETTLES

PLACE, FORCE_PLACE = "position-dependent-friction", "place-dependent force"
DIRECTION, TIME, LOAD = "direction-dependent-friction", "friction-drift", "load-dependent friction"
SPEED, MASS, CLOCKS = "friction over speed", "inertia", "clocks apart"
SCATTER, NOISE = "scatter", "noise"

# Rank correlation of place and time from which they are one variable. At 0.5 four further signals of the development sets count
# as passed once and lose their shares of time; 0.99 changes nothing there.
_ONE_VARIABLE = 0.9
# Half waves of a law of the speed. With three powers alone, 16 % of made records without a dependence on place show one beyond
# chance, as the speed of a harmonic motion goes with the place; with 8 half waves 4 %, with 16 8 %.
_BENDS = 8


class Waves(NamedTuple):
    """Waves of one cause over one variable; a factor of -1 turns the wave with the motion."""

    what: str
    at: Floats  # the variable, [rows], in steps from one row to the next
    factor: Floats  # [rows]
    lowest: float  # waves a step

    def columns(self, waves: float) -> Floats:
        """Cosine and sine of one wave, [rows, 2]."""
        phase = 2.0 * np.pi * waves * self.at
        return self.factor[:, None] * np.stack([np.cos(phase), np.sin(phase)], axis=1)

    def strongest(self, left: Floats, rows: Indices) -> tuple[float, float, int]:
        """The squares that the best wave takes from the remainder `left` [rows], its waves a step, frequencies tried."""
        bins = np.floor(2.0 * (self.at[rows] - self.at[rows].min())).astype(np.int64)
        size = 1 << (8 * (int(bins.max()) + 1) - 1).bit_length()  # 8 times as fine as the resolution
        spectrum = np.abs(np.fft.rfft(np.bincount(bins, self.factor[rows] * left), size)) ** 2
        first, last = max(math.ceil(0.5 * self.lowest * size), 1), size // 4
        if first >= last:
            return 0.0, 0.0, 1
        best = first + int(np.argmax(spectrum[first:last]))
        return 2.0 * float(spectrum[best]) / len(rows), 2.0 * best / size, (last - first) // 8 + 1


class Causes(NamedTuple):
    """All courses over the rows of one signal."""

    owners: tuple[str, ...]  # cause of each column
    columns: Floats  # [rows, columns], unit mean square on the fitted rows
    waves: tuple[Waves, ...]
    one_pass: bool  # place and time are one variable in these rows

    def without(self, what: str) -> "Causes":
        """The courses of the other causes."""
        kept = [number for number, owner in enumerate(self.owners) if owner != what]
        waves = tuple(wave for wave in self.waves if wave.what != what)
        return Causes(tuple(self.owners[i] for i in kept), self.columns[:, kept], waves, self.one_pass)


def causes_of(rows: ExcessRows, fit: Indices) -> Causes:
    """The causes that can act in these rows; `fit`: the fitted rows."""
    runs, of_row = np.unique(rows.run, return_inverse=True)
    in_run_s = rows.t_s - np.array([rows.t_s[rows.run == run].min() for run in runs])[of_row]
    one_pass = any(abs(_rank_correlation(rows.place_m, time)) > _ONE_VARIABLE for time in (rows.t_s, in_run_s))
    both_ways = len(np.unique(rows.sign)) > 1
    ones = np.ones(len(rows.sign))
    # fewer than two waves in one pass are a slow course, over place or over time
    waves = [_waves(PLACE, rows.place_m, ones, fit, 2.0 if one_pass else 0.5)]
    columns = [(SPEED, column) for column in _bends(np.log(np.maximum(rows.speed_mps, 1e-12)), fit)]
    if both_ways:
        columns.append((DIRECTION, rows.sign))
        # half a wave over the place is nearly a constant force, which the direction explains
        waves.append(_waves(FORCE_PLACE, rows.place_m, rows.sign, fit, 2.0 if one_pass else 1.0))
    if not one_pass:
        for time in (rows.t_s, in_run_s):
            long_s = max(float(np.ptp(time[fit])), 1e-12)
            columns += [(TIME, time), *((TIME, np.exp(-time / share / long_s)) for share in SETTLES)]
    for what, values in ((LOAD, rows.load_N), (MASS, rows.pull_N), (CLOCKS, rows.rate_N_per_s)):
        if values is not None:
            columns.append((what, values))
    kept: list[tuple[str, Floats]] = []
    for what, column in columns:
        about = column - column[fit].mean()
        size = float(np.sqrt(np.mean(about[fit] ** 2)))
        if size > 1e-9 * float(np.abs(column).max()):
            kept.append((what, about / size))
    table = np.array([column for _, column in kept]).reshape(len(kept), len(ones)).T
    return Causes(tuple(what for what, _ in kept), table, tuple(wave for wave in waves if wave is not None), one_pass)


def _rank_correlation(place: Floats, time: Floats) -> float:
    return (
        float(np.corrcoef(rankdata(place), rankdata(time))[0, 1]) if np.ptp(place) > 0.0 and np.ptp(time) > 0.0 else 0.0
    )


def _waves(what: str, at: Floats, factor: Floats, fit: Indices, fewest: float) -> Waves | None:
    """Waves over `at`, of which the fitted rows hold `fewest` at least; None where the variable is constant."""
    steps = np.abs(np.diff(at[fit]))
    long = float(np.ptp(at[fit]))
    if long <= 0.0:
        return None
    step = max(float(np.median(steps[steps > 0.0])), long / len(fit))
    return Waves(what, at / step, factor, fewest * step / long)


def _bends(values: Floats, fit: Indices) -> list[Floats]:
    """Smooth courses, from three powers to `_BENDS` half waves; constant beyond the range of the fitted rows."""
    low, high = float(values[fit].min()), float(values[fit].max())
    across = np.clip((values - low) / max(high - low, 1e-12), 0.0, 1.0)
    waves = (np.cos(np.pi * number * across) for number in range(2, _BENDS + 1))
    return [across, across**2, across**3, *waves]
