"""The diagnosis of today, and BIC over its single refits. The fits take half a minute a case, so they are kept in fits.json.gz.

BIC stays a rival when the diagnosis makes no refits any more: `python -m bench judge --keep-fits` replaced the file last at the
version that it names.
"""

import gzip
import json
import math
import time
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from bench.blind.outcomes import with_unexplained
from bench.blind.sealing import evidence_hash
from bench.judge.cases import Case
from bridge.faults import Fault
from bridge.files import replacing
from bridge.results import strict_json
from diagnosis.diagnose import diagnose
from diagnosis.evidence.folder import load_evidence
from diagnosis.result import Diagnosis
from diagnosis.version import tool_version

KEPT = Path(__file__).with_name("fits.json.gz")
Answer = dict[str, float]


def verdict(folder: Path, budget_s: float | None) -> Answer:
    """The verdict of the diagnosis; `cpu_s` where the kept fits are of this version."""
    kept = _kept()
    row = kept["cases"].get(_key(folder)) if kept["tool"] == tool_version() else None
    if row is not None:
        return row["verdict"] | {"cpu_s": row["cpu_s"]}
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
    """The candidates of a diagnosis; two named effects are one name with the probability of the first."""
    table = strict_json(done)
    answer = with_unexplained(table["candidates"], table["complete"])
    answer["outside"] = answer.pop("unexplained")
    if len(done.effects) == 2:
        together = max(answer.pop(effect, 0.0) for effect in done.effects)
        answer[" + ".join(sorted(done.effects))] = together
    return answer


def keep_fits(cases: Sequence[Case]) -> Iterator[str]:
    """Diagnose the cases without kept fits of this version; write the fits of each at once, and yield its name."""
    kept: dict[str, Any] = _kept()
    if kept["tool"] != tool_version():
        kept = {"tool": tool_version(), "cases": {}}
    for case in cases:
        if _key(case.folder) in kept["cases"]:
            continue
        kept["cases"][_key(case.folder)] = _fits(case.folder)
        text = json.dumps(kept, separators=(",", ":"), sort_keys=True)
        with replacing(KEPT) as file:
            file.write(gzip.compress(text.encode(), mtime=0))
        yield case.name


def _fits(folder: Path) -> dict[str, Any]:
    before = time.process_time()
    try:
        done = diagnose(load_evidence(folder), _no_report)
    except Fault as fault:
        return {"chi2": {}, "features": 0, "verdict": {}, "cpu_s": time.process_time() - before, "fault": fault.line}
    return {
        "chi2": {
            candidate.effect: (round(candidate.chi2, 2), len(candidate.parameters))
            for candidate in done.candidates
            if candidate.chi2 is not None
        },
        "features": done.compared_features,
        "verdict": {name: round(value, 5) for name, value in as_answer(done).items()},
        "cpu_s": round(time.process_time() - before, 1),
    }


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
