"""Probabilities of the explanations of an evidence, and of an effect that the library lacks."""

import json
from functools import cache
from pathlib import Path

from bench.judge.weighed.columns import table_of
from bench.judge.weighed.seen import Seen, seen_of
from bench.judge.weighed.weights import Weights
from diagnosis.evidence.folder import load_evidence

WEIGHTS = Path(__file__).with_name("weights.json")
OUTSIDE, NONE = "outside", "none"
# Probability that a vibration which the library cannot make is more than a pick-up. Below a half: it alone is never outside.
_FOREIGN = 0.8


def answer(folder: Path, budget_s: float | None) -> dict[str, float]:  # noqa: ARG001
    """Probabilities of the explanations, which add up to 1, and of `outside`."""
    return judged(seen_of(load_evidence(folder)), _weights())


def judged(seen: Seen, weights: Weights) -> dict[str, float]:
    """The answer from the evidences."""
    table = table_of(seen)
    names = (" + ".join(sorted(each)) or NONE for each in table.names)
    result = dict(zip(names, weights.probabilities(table).tolist(), strict=True))
    within = (1.0 - weights.beyond(table)) * (1.0 - seen.beyond) * (1.0 - (_FOREIGN if seen.foreign else 0.0))
    return result | {OUTSIDE: 1.0 - within}


@cache
def _weights() -> Weights:
    return Weights.read(json.loads(WEIGHTS.read_text(encoding="utf-8")))
