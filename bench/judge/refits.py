"""The diagnosis of today; and BIC over the single refits of the diagnosis before the judge had a ledger.

That diagnosis refitted every effect, half a minute a case, which today's does not; its fits are kept in fits.json.gz.
"""

import gzip
import json
import math
from functools import cache
from pathlib import Path
from typing import Any

from bench.blind.sealing import evidence_hash
from diagnosis.diagnose import diagnose
from diagnosis.evidence.folder import load_evidence
from diagnosis.result import Diagnosis

KEPT = Path(__file__).with_name("fits.json.gz")
Answer = dict[str, float]


def verdict(folder: Path, budget_s: float | None) -> Answer:
    """The verdict of the diagnosis."""
    return as_answer(diagnose(load_evidence(folder), _no_report, 1, budget_s))


def bic(folder: Path, budget_s: float | None) -> Answer | None:  # noqa: ARG001
    """Probabilities of none and of the single effects by BIC over kept refits; None without them."""
    row = _kept()["cases"].get(_key(folder))
    if row is None:
        return None
    return by_bic(row["chi2"], row["features"]) | {"outside": 0.0, "cpu_s": row["cpu_s"]}


def by_bic(chi2: dict[str, tuple[float, int]], features: int) -> Answer:
    """The weights of models from chi2 and number of parameters each; `features` is the number of compared features."""
    values = {name: left + count * math.log(max(features, 1)) for name, (left, count) in chi2.items()}
    least = min(values.values(), default=0.0)
    weights = {name: math.exp(-0.5 * (value - least)) for name, value in values.items()}
    return {name: weight / sum(weights.values()) for name, weight in weights.items()}


def as_answer(done: Diagnosis) -> Answer:
    """The candidates of a diagnosis, and whether something else acts; two named effects are one name."""
    answer = {row.effect: row.probability for row in done.candidates if math.isfinite(row.probability)}
    if len(done.effects) == 2 and answer:
        answer[" + ".join(sorted(done.effects))] = sum(answer.pop(effect) for effect in done.effects)
    return answer | {"outside": 1.0 - done.complete} if answer else {}


@cache
def _kept() -> dict[str, Any]:
    if not KEPT.exists():
        return {"tool": "", "cases": {}}
    return json.loads(gzip.decompress(KEPT.read_bytes()))


@cache
def _key(folder: Path) -> str:
    return evidence_hash(folder)[:16]


def _no_report(_line: str, _share: float) -> None:
    """Drop the progress within a case: it is reported per case."""
