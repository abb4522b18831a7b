"""Courses chosen one after the other, as long as each fitted run is better predicted from the other runs.

Orthogonal matching pursuit (Pati, Rezaiifar, Krishnaprasad 1993). The number of courses is chosen by cross-validation over whole
runs, or over the halves of a single run, because a held-out run is not adjacent to the fitted rows.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from bridge.arrays import Floats, Indices
from diagnosis.latent.causes import Causes

# Parts of a single fitted run. With 4 a course may be chosen because it bridges a gap between two parts: on measured sliders that
# pass a track once it then predicts the held-out rows worse than the mean (shares of -0.9 to -1.6). With 1 nothing is left out.
_PARTS = 2
# Share of the squares that a further course must predict. At 0 a record of 2300 rows takes 47 s of CPU for shares below 0.01, at
# 0.003 the development sets take 1.6 times as long and no name changes; at 0.03 the error of made shares grows by 2 %.
_LEAST = 0.01


class Chosen(NamedTuple):
    """Courses with their cause, one row of `columns` for each column."""

    owners: tuple[str, ...]
    columns: Floats  # [rows, columns]
    sizes: Floats  # [columns]

    def of(self, what: str) -> Floats:
        """Prediction of one cause, [rows]."""
        of_cause = [number for number, owner in enumerate(self.owners) if owner == what]
        return self.columns[:, of_cause] @ self.sizes[of_cause]

    @property
    def whole(self) -> Floats:
        """Prediction of all causes, [rows]."""
        return self.columns @ self.sizes


def predicted(causes: Causes, y: Floats, fit: Indices, run: Indices) -> Chosen:
    """Fit the courses and predict all rows, about the mean of the fitted rows.

    Args:
        causes: the courses to choose from.
        y: level of friction [rows]; only `fit` is used.
        fit: the fitted rows.
        run: number of the run [rows].

    """
    pieces = _pieces(fit, run)
    paths = [_path(causes, y, np.setdiff1d(fit, piece)) for piece in pieces]
    errors: list[float] = []
    while len(errors) < 2 or errors[-1] < errors[-2] - _LEAST * errors[0]:
        steps = [next(path) for path in paths]
        errors.append(
            sum(
                float(np.sum((y[piece] - level - chosen.whole[piece]) ** 2))
                for piece, (chosen, level) in zip(pieces, steps, strict=True)
            )
        )
    path = _path(causes, y, fit)
    for _ in range(len(errors) - 2):
        next(path)
    chosen, _ = next(path)
    return chosen._replace(columns=chosen.columns - chosen.columns[fit].mean(axis=0))


def _pieces(fit: Indices, run: Indices) -> list[Indices]:
    """The fitted rows run by run; a single run in parts."""
    runs = [fit[run[fit] == number] for number in np.unique(run[fit])]
    return runs if len(runs) > 1 else np.array_split(fit, _PARTS)


def _path(causes: Causes, y: Floats, rows: Indices) -> Iterator[tuple[Chosen, float]]:
    """The best courses on `rows`: none, one, two and so on, with the level; the last again where none is above chance."""
    owners: list[str] = []
    columns = np.empty((len(y), 0))
    ones = np.ones((len(rows), 1))
    while True:
        inside = np.concatenate([ones, columns[rows]], axis=1)
        gram = inside.T @ inside
        gram[np.diag_indices_from(gram)] *= 1.0 + 1e-9
        sizes = np.linalg.solve(gram, inside.T @ y[rows])
        yield Chosen(tuple(owners), columns, sizes[1:]), float(sizes[0])
        added = _best(causes, y[rows] - inside @ sizes, rows) if len(sizes) < len(rows) // 2 else None
        if added is not None:
            owners += [added[0]] * added[1].shape[1]
            columns = np.concatenate([columns, added[1]], axis=1)


def _best(causes: Causes, left: Floats, rows: Indices) -> tuple[str, Floats] | None:
    """The course that takes most squares beyond the most that noise gives to one of as many courses."""
    noise = float(left @ left) / len(left)
    best, course = 0.0, None
    if len(causes.owners):
        about = causes.columns[rows] - causes.columns[rows].mean(axis=0)
        gains = (left @ about) ** 2 / np.maximum(np.sum(about**2, axis=0), 1e-12)
        number = int(np.argmax(gains))
        best = float(gains[number]) - 2.0 * noise * math.log(len(gains))
        course = (causes.owners[number], causes.columns[:, [number]]) if best > 0.0 else None
    best = max(best, 0.0)
    for waves in causes.waves:
        gain, at, tried = waves.strongest(left, rows)
        gain -= 2.0 * noise * math.log(tried)
        if gain > best:
            best, course = gain, (waves.what, waves.columns(at))
    return course
