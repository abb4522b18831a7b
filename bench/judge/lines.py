"""Straight lines over all samples: each effect's columns in each relation, ranked by evidence. No simulation, no fit."""

import math
from collections import defaultdict
from pathlib import Path

import numpy as np

from bench.judge.columns import Block, binned, blocks
from bridge.arrays import Floats
from diagnosis.evidence.folder import load_evidence
from diagnosis.gap.prepare import prepare

# Temperature of the softmax over log evidences, which are too sure as columns are not the true formulas; and its prior for none.
_TEMPERATURE, _NONE = 4.0, 14.0
_MUST_LEAVE = 0.8
_OUTSIDE = 40.0  # log evidence that a free function must have beyond the best effect to count as outside the library
_FREE_BLOCKS = ("spring", "motion")


def answer(folder: Path, budget_s: float | None) -> dict[str, float]:  # noqa: ARG001
    """Probabilities of names, of none and of outside."""
    evidence = load_evidence(folder)
    total: dict[str, float] = defaultdict(float)
    beyond = -math.inf
    for block in blocks(evidence.rig, prepare(evidence)):
        by_effect, free = evidences(block)
        for effect, value in by_effect.items():
            total[effect] += max(value, 0.0)
        if block.name in _FREE_BLOCKS:
            beyond = max(beyond, free - max(by_effect.values(), default=0.0))
    values = {"none": _NONE, **total}
    most = max(values.values())
    weights = {name: math.exp((value - most) / _TEMPERATURE) for name, value in values.items()}
    result = {name: weight / sum(weights.values()) for name, weight in weights.items()}
    return result | {"outside": 1.0 / (1.0 + math.exp(min(max((_OUTSIDE - beyond) / 10.0, -50.0), 50.0)))}


def evidences(block: Block) -> tuple[dict[str, float], float]:
    """Log evidence of each effect against the nuisances alone, and of the best free function.

    The noise is unknown: a model is judged by the logarithm of its remainder, in as many rows as are independent in the
    remainder of the best model.
    """
    scale = np.sqrt(np.mean(block.nuisances**2, axis=0)) + 1e-300
    base, spread = block.nuisances / scale, block.spread * scale
    width = base.shape[1]
    by_bare = np.linalg.lstsq(base, block.y, rcond=1e-8)[0]
    noise = float(np.mean((block.y - base @ by_bare) ** 2)) + 1e-30
    nothing = _fitted(base, spread, block.y, noise)[0]
    models: list[
        tuple[str, float, int, int, Floats]
    ] = []  # effect, chi2, further columns, forms of the effect, remainder

    def add(effect: str, values: Floats, sign: int, forms: int) -> None:
        unit = values / (np.sqrt(np.mean(values**2, axis=0)) + 1e-300)
        columns = np.concatenate([base, unit], axis=1)
        chi2, sizes = _fitted(columns, np.append(spread, np.full(values.shape[1], np.inf)), block.y, noise)
        if sign * sizes[width] >= 0.0:
            models.append((effect, chi2, values.shape[1], forms, block.y - columns @ sizes))

    for effect, values, sign in block.columns:
        add(effect, values, sign, sum(name == effect for name, _, _ in block.columns))
    for effect, column in block.freed.items():
        wide = np.where(np.arange(width) == column, np.inf, spread)
        chi2, sizes = _fitted(base, wide, block.y, noise)
        models.append((effect, chi2, 1, 1, block.y - base @ sizes))
    for variable in block.free.values():
        add("", binned(variable)[:, 1:], 0, 1)
    if not models:
        return {}, -math.inf
    # a free function counts where it takes a fifth of the best effect's remainder, as formulas are not exact
    least = min((model[1] for model in models if model[0]), default=nothing)
    models = [model for model in models if model[0] or model[1] < _MUST_LEAVE * least]
    rows = len(block.y) / _correlated(min(models, key=lambda model: model[1])[4])
    result: dict[str, float] = {}
    for effect, chi2, count, forms, _ in models:
        value = (
            0.5 * rows * math.log(max(nothing, 1e-9) / max(chi2, 1e-9)) - 0.5 * count * math.log(rows) - math.log(forms)
        )
        result[effect] = max(result.get(effect, -math.inf), value)
    return result, result.pop("", -math.inf)


def _correlated(left: Floats) -> float:
    """Rows for one independent row: the sum of the autocorrelation until it falls below a tenth."""
    about = left - left.mean()
    spectrum = np.abs(np.fft.rfft(about, 2 * len(about))) ** 2
    correlation = np.fft.irfft(spectrum)[: len(about)]
    correlation = correlation / max(float(correlation[0]), 1e-300)
    end = int(np.argmax(correlation < 0.1)) or len(correlation)
    return float(np.clip(1.0 + 2.0 * correlation[1:end].sum(), 1.0, len(left) / 10.0))


def _fitted(columns: Floats, spread: Floats, y: Floats, noise: float) -> tuple[float, Floats]:
    """Chi2 with the prior at the best sizes, and these sizes."""
    inner = columns.T @ columns / noise + np.diag(1.0 / spread**2)
    towards = columns.T @ y / noise
    sizes = np.linalg.lstsq(inner, towards, rcond=1e-12)[0]
    left = y - columns @ sizes
    return float(left @ left / noise + np.sum((sizes / spread) ** 2)), sizes
