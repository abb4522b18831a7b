"""The drive relation: the drive's position less an even path between two changes of command."""

import math
from collections.abc import Sequence

import numpy as np
from scipy.fft import next_fast_len, rfft, rfftfreq

from diagnosis.evidence.manifest import RigTable
from diagnosis.features.feature import RESOLVED
from diagnosis.features.grid import BLOCK_S
from diagnosis.gap.prepare import Prepared
from diagnosis.relations.relation import (
    LARGE,
    POSITION_HZ,
    Floats,
    Missing,
    Piece,
    Relation,
    Term,
    kept_blocks,
    pieces_of,
    wander,
)
from diagnosis.relations.shapes import hats, knots_of

# Waves up to half a line next to the strongest that become columns: far above the noise, a wave shows its period to a part of a
# line. With 1 a period of 1.033 mm is read as 1.04 mm, which does not predict the held-out run. With 17 relations take 1.3 times
# as long.
_NEARBY = 7
_WANDER = 5e-5  # slow drift of a displacement sensor, as a share of the travel
_FEWEST_TURNS = 2.0  # of a wave in the longest piece; a slower one is a wander of the sensor
# Bins of the shortest wave, of which they keep 97 %, and lines for each turn. Fewer: a wave between two is lost. More: time.
_BINS, _LINES = 8, 4


def drive_relation(rig: RigTable, runs: list[Prepared]) -> Relation | Missing:
    """The relation in m; `Missing` where a run has no drive position, or no drive ever moves evenly."""
    if rig.drive == "force":
        return Missing("drive", 'drive = "force": the rig has no moving drive')
    for run in runs:
        if "drive_position_m" not in run.signals:
            return Missing("drive", f"{run.file} has no drive_position_m: its path is taken as commanded")
    pieces = tuple(_even(run) for run in runs)
    fitted = [i for i, run in enumerate(runs) if not run.holdout and pieces[i]]
    if not fitted:
        return Missing("drive", "no stretch of constant speed is long enough")
    measured = [run.signals["drive_position_m"] for run in runs]
    own_s = [(np.arange(len(s)) + 0.5) * BLOCK_S for s in measured]
    speed = [np.abs(run.commands.drive) for run in runs]
    left = [_without_parabola(s, pieces_of) for s, pieces_of in zip(measured, pieces, strict=True)]
    # of the even path: a function of the measured place could be that place itself, and then leaves nothing of anything
    place = [s - uneven for s, uneven in zip(measured, left, strict=True)]
    rows = [(i, slice(*piece)) for i in fitted for piece in pieces[i]]
    travel_m = max(float(np.ptp(place[i][piece])) for i, piece in rows)
    if float(np.mean(np.concatenate([left[i][piece] for i, piece in rows]) ** 2)) <= (RESOLVED * travel_m) ** 2:
        return Missing("drive", "the drive position is the commanded path, not a measurement")
    effects: list[Term] = []
    for per_m in _strongest(place, left, rows):
        angles = [2.0 * math.pi * per_m * s for s in place]
        amplitude_m = LARGE / (2.0 * math.pi * per_m)
        effects.append(_wave("drive-speed-ripple", f"every {1e3 / per_m:.3g} mm", angles, None, pieces, amplitude_m))
    for each_Hz in _strongest(own_s, left, rows):
        angles = [2.0 * math.pi * each_Hz * t for t in own_s]
        effects.append(
            _wave("drive-speed-ripple", f"{each_Hz:.3g} Hz", angles, speed, pieces, LARGE / (2.0 * math.pi * each_Hz))
        )
    knots = knots_of(np.concatenate(place), 60)
    slow = wander([len(s) for s in place], _WANDER * travel_m)
    return Relation(
        name="drive", unit="m", row_s=BLOCK_S, highest_Hz=POSITION_HZ, left=tuple(left), pieces=pieces,
        nuisances=(
            slow._replace(values=tuple(_without_parabola(s, parts) for s, parts in zip(slow.values, pieces, strict=True))),
        ),
        effects=tuple(effects),
        patterns=(
            Term("the place of the drive", "", tuple(
                _without_parabola(hats(s, knots), pieces_of) for s, pieces_of in zip(place, pieces, strict=True)), math.nan),
        ),
        resolution=RESOLVED * travel_m,
    )  # fmt: skip


def _even(run: Prepared) -> tuple[Piece, ...]:
    kept = kept_blocks(run)
    even = np.zeros(len(kept), np.bool_)
    for segment in run.commands.segments:
        even[segment.first : segment.last] = segment.drive_velocity_mps != 0.0
    return pieces_of(kept & even)


def _without_parabola(values: Floats, pieces: tuple[Piece, ...]) -> Floats:
    """`values` [rows] or [rows, columns] less a parabola in each piece: the initial speed, and the bow of the sensor."""
    result = np.zeros_like(values)
    for first, last in pieces:
        basis = np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, last - first), 2)
        basis, _ = np.linalg.qr(basis)
        part = values[first:last]
        result[first:last] = part - basis @ (basis.T @ part)
    return result


def _strongest(over: Sequence[Floats], left: Sequence[Floats], rows: list[tuple[int, slice]]) -> list[float]:
    """Turns per unit of the wave over a variable that takes most of the rest, of any length, and of some near it.

    Args:
        over: place or time, [rows of the run] each.
        left: the rest, [rows of the run] each.
        rows: run and rows of each piece.

    """
    lengths = [float(np.ptp(over[i][piece])) for i, piece in rows]
    # half the highest compared frequency at the mean speed, as each wave has a second harmonic
    highest = 0.5 * POSITION_HZ * BLOCK_S * sum(piece.stop - piece.start for _, piece in rows) / sum(lengths)
    at = np.concatenate([over[i][piece] for i, piece in rows])
    bins = np.floor((at - at.min()) * _BINS * highest).astype(np.int64)
    summed = np.bincount(bins, np.concatenate([left[i][piece] for i, piece in rows]))
    count = next_fast_len(_LINES * len(summed))
    turns = rfftfreq(count, 1.0 / (_BINS * highest))
    inside = (turns >= _FEWEST_TURNS / max(lengths)) & (turns <= highest)
    strongest = turns[inside][np.abs(np.asarray(rfft(summed, count)))[inside].argmax()]
    return (strongest + np.linspace(-0.5, 0.5, _NEARBY) * turns[1]).tolist()


def _wave(
    cause: str,
    form: str,
    angles: Sequence[Floats],
    factor: list[Floats] | None,
    pieces: tuple[tuple[Piece, ...], ...],
    amplitude: float,
) -> Term:
    values: list[Floats] = []
    for i, angle in enumerate(angles):
        columns = np.stack([np.sin(angle), np.cos(angle), 0.5 * np.sin(2.0 * angle), 0.5 * np.cos(2.0 * angle)], axis=1)
        if factor is not None:
            columns = columns * factor[i][:, None]
        values.append(_without_parabola(columns, pieces[i]))
    return Term(cause, form, tuple(values), amplitude, 0, "amplitude_m" if factor is None else "amplitude_s")
