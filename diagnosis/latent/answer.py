"""The latent friction of an evidence: each signal with its sizes and shares, and what is named."""

from typing import NamedTuple

import numpy as np

from diagnosis.evidence.manifest import RigTable
from diagnosis.gap.prepare import Prepared
from diagnosis.latent.axis_rows import axis_rows
from diagnosis.latent.components import NOISE, SCATTER, model_of
from diagnosis.latent.reml import fitted
from diagnosis.latent.rows import BREAKAWAY, SLIDING, ExcessRows, together
from diagnosis.latent.shares import LatentShare, shares_of
from diagnosis.latent.spring_rows import spring_rows

_FEWEST = 12  # rows to fit, or no variance is known
_FEWEST_HELD_OUT = 6  # rows to judge on; with fewer the fitted rows are judged


class LatentSignal(NamedTuple):
    """One signal, split. Sizes are standard deviations in N."""

    signal: str
    shares: tuple[LatentShare, ...]
    described: float  # rms about the level that the rig table describes
    differs: float  # about the mean of the rows
    left: float  # of scatter and noise
    noise: float
    revisited: bool  # whether place and time are two things here
    judged_on_held_out: bool
    rows: int


def latent_of(rig: RigTable, runs: list[Prepared]) -> tuple[LatentSignal, ...]:
    """Split the friction of all runs; fitted to those that are not held out. Signals with too few rows are left out."""
    parts = axis_rows(rig, runs) if rig.drive == "force" else spring_rows(rig, runs)
    signals: list[LatentSignal] = []
    for signal in (BREAKAWAY, SLIDING):
        rows = together([part for part in parts if part.signal == signal])
        if rows is None:
            continue
        rows = rows.thinned()
        if int((~rows.held_out).sum()) >= _FEWEST:
            signals.append(signal_of(rows))
    return tuple(signals)


def signal_of(rows: ExcessRows) -> LatentSignal:
    """One signal, split."""
    fit = np.flatnonzero(~rows.held_out)
    held = np.flatnonzero(rows.held_out)
    judged_on_held_out = len(held) >= _FEWEST_HELD_OUT
    held = held if judged_on_held_out else fit
    best = fitted(model_of(rows), rows.excess_N, fit)
    shares = shares_of(best, rows, fit, held)
    differs = float(rows.excess_N[held].std())
    explained = sum(share.share for share in shares if share.what not in (SCATTER, NOISE))
    return LatentSignal(
        signal=rows.signal,
        shares=shares,
        described=float(np.sqrt(np.mean(rows.excess_N[held] ** 2))),
        differs=differs,
        left=max(differs * float(np.sqrt(min(max(1.0 - explained, 0.0), 1.0))), min(rows.noise_N, differs)),
        noise=min(rows.noise_N, differs),
        revisited=best.model.revisited,
        judged_on_held_out=judged_on_held_out,
        rows=len(rows.excess_N),
    )
