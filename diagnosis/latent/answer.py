"""The latent friction of an evidence: each signal with its sizes and shares; effects that it shows where no formula does."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from diagnosis.evidence.manifest import RigTable
from diagnosis.gap.prepare import Prepared
from diagnosis.latent.axis_rows import axis_rows
from diagnosis.latent.causes import DIRECTION, PLACE, TIME
from diagnosis.latent.rows import BREAKAWAY, SLIDING, ExcessRows, together
from diagnosis.latent.shares import LatentShare, shares_of
from diagnosis.latent.spring_rows import spring_rows

_KNOWN = (PLACE, DIRECTION, TIME)  # causes that are effects of the library
MOST = 0.5  # share below which a cause is reported and not named: the rest would be the answer
_FEWEST = 6  # rows to fit, and to predict
# Correlation of the remainder from row to row from which it varies slowly. At 0.7 tracks measured once are reported in 9
# signals of the development sets and not in 16; 0.3 changes nothing there.
_SLOW = 0.5


class LatentSignal(NamedTuple):
    """One signal, split. Sizes are root mean squares over the held-out rows in N."""

    signal: str
    shares: tuple[LatentShare, ...]
    described: float  # about the level that the rig table describes
    differs: float  # about the mean of the fitted rows
    left: float  # that no cause predicts
    noise: float
    varies_slowly: bool  # the remainder does, over place and time alike: these runs do not separate them
    rows: int


def latent_of(rig: RigTable, runs: list[Prepared]) -> tuple[LatentSignal, ...]:
    """Split the friction of all runs. A signal with too few rows in the fitted or the held-out runs is left out."""
    parts = axis_rows(rig, runs) if rig.drive == "force" else spring_rows(rig, runs)
    signals: list[LatentSignal] = []
    for signal in (BREAKAWAY, SLIDING):
        rows = together([part for part in parts if part.signal == signal])
        if rows is None:
            continue
        rows = rows.thinned()
        held = int(rows.held_out.sum())
        if len(rows.held_out) - held >= _FEWEST and held >= _FEWEST:
            signals.append(signal_of(rows))
    return tuple(signals)


def signal_of(rows: ExcessRows) -> LatentSignal:
    """One signal, split."""
    split = shares_of(rows)
    held = rows.excess_N[rows.held_out]
    differs = _rms(held - rows.excess_N[~rows.held_out].mean())
    *_, scatter, noise = split.shares
    return LatentSignal(
        signal=rows.signal,
        shares=split.shares,
        described=_rms(held),
        differs=differs,
        left=differs * (scatter.share + noise.share) ** 0.5,
        noise=rows.noise_N,
        varies_slowly=split.one_pass and split.slow > _SLOW,
        rows=len(rows.excess_N),
    )


def named_by(latent: Sequence[LatentSignal]) -> tuple[str, ...]:
    """Effects that predict more than half of a signal, more than chance does, with a size that is the same in all runs."""
    largest: dict[str, float] = {}
    for signal in latent:
        for share in signal.shares if signal.left < signal.differs else ():
            if share.what in _KNOWN and share.beyond_chance and share.agrees and share.share > MOST:
                largest[share.what] = max(share.share, largest.get(share.what, 0.0))
    return tuple(sorted(largest, key=lambda what: -largest[what]))


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))
