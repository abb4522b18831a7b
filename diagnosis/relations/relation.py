"""One relation between channels as a regression: its residual for the rig as described, and the columns that may explain it."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.ndimage import maximum_filter1d

from bridge.arrays import Bools, Floats
from diagnosis.features.segments import SETTLING
from diagnosis.gap.prepare import Prepared

Piece = tuple[int, int]  # rows [first, last) of a run, without a hole
# Causes that no effect of the library makes.
OUTSIDE = frozenset({"acceleration-clock", "logger-clock"})
# Rows of a piece. Shorter: slips have its lowest frequencies, and columns pass for noise. Longer: pieces are lost.
_SHORTEST = 300
_SPARE = 1.5  # by which the rows of a thinned relation still resolve more than its highest frequency
_WAVES = 4  # half waves of a slow drift over a run
# least noise of a row, as a share of the static friction, or of the acceleration that it gives the slide
RESOLUTION = 1e-5
POSITION_HZ = 60.0  # content of a position, or of its second derivative, that is compared: above is noise of the sensor
# Size of a large effect, as a share of the drive's critical damping, compliance, speed, or of the largest force. Ten times as
# much or as little changes a log evidence by 2.3.
LARGE = 0.1
SKEW = 5e-4  # between two recorders of which one is timed by software
# Time constants of settling processes, in lengths of the longest run: steps of 2.5, which a spread of sizes bridges
SETTLES = (1.0, 0.4, 0.15, 0.06)


class Term(NamedTuple):
    """Columns of one cause in one formula, by run.

    Arrays of `values` are [rows of the run, columns]: the relation's unit for each unit of the coefficients.
    """

    cause: str  # an effect of the library, one of OUTSIDE, or the meaning of a nuisance or pattern
    form: str
    values: tuple[Floats, ...]
    spread: float  # standard deviation of the coefficients before the data
    sign: int = 0  # of the coefficient where the mechanism has one only
    size: str = ""  # name with unit of the coefficient, as a parameter of an effect has
    of_run: bool = False  # whether each run has its own coefficients, which no other run shows


class Relation(NamedTuple):
    """A relation over all runs of an evidence. Lists are [runs]; arrays of `left` are [rows of the run]."""

    name: str
    unit: str
    row_s: float  # seconds from row to row
    highest_Hz: float  # of the content that is compared
    left: tuple[Floats, ...]  # residual of the rig as described
    pieces: tuple[tuple[Piece, ...], ...]
    nuisances: tuple[Term, ...]  # sensors and tolerances
    effects: tuple[Term, ...]
    patterns: tuple[Term, ...]  # free functions of one variable, for the part that no effect explains
    resolution: float  # least noise, one standard deviation a row: rounding of a channel is not below it
    keeps_mean: bool = False  # whether the mean of a piece is compared, not only the variation in it


class Missing(NamedTuple):
    """A relation that the channels do not allow."""

    name: str
    why: str


def term(cause: str, form: str, values: Sequence[Floats], spread: float, sign: int = 0, size: str = "") -> Term:
    """A term of one column; `values` are [rows of the run] each."""
    return Term(cause, form, tuple(np.asarray(value, np.float64)[:, None] for value in values), spread, sign, size)


def lacking(needed: Sequence[str], runs: Sequence[Prepared]) -> str:
    """Which run lacks which of the needed channels, in words; empty where none does."""
    return next((f"{run.file} has no {name}" for run in runs for name in needed if name not in run.signals), "")


def wander(lengths: list[int], spread: float) -> Term:
    """Slow drift of a channel as a nuisance: `_WAVES` half waves over each run, together `spread` large."""
    values: list[Floats] = []
    for number, length in enumerate(lengths):
        columns = np.zeros((length, len(lengths) * _WAVES))
        turns = np.outer(np.linspace(0.0, np.pi, length), np.arange(1, _WAVES + 1))
        columns[:, number * _WAVES : (number + 1) * _WAVES] = np.cos(turns)
        values.append(columns)
    return Term("wander", "", tuple(values), spread / math.sqrt(_WAVES), of_run=True)


def kept_blocks(run: Prepared) -> Bools:
    """Marks the blocks away from changes of command and from the ends of the run, while drive and piezo settle, [blocks]."""
    commands = run.commands
    changes = np.zeros(len(commands.drive))
    changes[0] = changes[-1] = 1.0
    if any(segment.drive_velocity_mps != 0.0 for segment in commands.segments):
        for command in (commands.drive, commands.frequency_Hz, commands.amplitude_m):
            changes[1:] += np.diff(command) != 0.0
    return np.asarray(maximum_filter1d(changes, 2 * SETTLING + 1) == 0.0)


def pieces_of(kept: Bools, shortest: int = _SHORTEST) -> tuple[Piece, ...]:
    """The stretches that are kept throughout and have `shortest` rows at least."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], kept, [False])).astype(np.int8)))
    return tuple(
        (int(first), int(last)) for first, last in zip(edges[::2], edges[1::2], strict=True) if last - first >= shortest
    )


def pieces_without_vibration(
    name: str, needed: Sequence[str], runs: Sequence[Prepared]
) -> tuple[tuple[Piece, ...], ...] | Missing:
    """The pieces of each run away from vibration; `Missing` where a run lacks a channel or the fitted runs have no piece."""
    if why := lacking(needed, runs):
        return Missing(name, why)
    pieces = tuple(pieces_of(kept_blocks(run) & (run.commands.frequency_Hz == 0.0)) for run in runs)
    if not any(run_pieces for run_pieces, run in zip(pieces, runs, strict=True) if not run.holdout):
        return Missing(name, "no stretch without vibration is long enough")
    return pieces


def thinned(relation: Relation) -> Relation:
    """The relation on means over as many rows as its highest frequency allows: all columns are averaged alike."""
    count = int(0.5 / (_SPARE * relation.highest_Hz * relation.row_s))
    if count < 2:
        return relation

    def mean(values: Floats) -> Floats:
        rows = len(values) // count
        return values[: rows * count].reshape(rows, count, *values.shape[1:]).mean(axis=1)

    def fewer(terms: tuple[Term, ...]) -> tuple[Term, ...]:
        return tuple(term._replace(values=tuple(mean(values) for values in term.values)) for term in terms)

    return relation._replace(
        row_s=count * relation.row_s,
        left=tuple(mean(values) for values in relation.left),
        pieces=tuple(tuple((-(-first // count), last // count) for first, last in piece) for piece in relation.pieces),
        nuisances=fewer(relation.nuisances),
        effects=fewer(relation.effects),
        patterns=fewer(relation.patterns),
    )
