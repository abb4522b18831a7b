"""The oracle: how much of the held-out gap the library closes when the names of the true effects are known.

The oracle has the formulas of the library, which differ from the formulas of the case, so a gap remains. A case takes half a
minute, so its shrinkage is kept in SET/oracle; another version of the tool computes it again.
"""

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from joblib import Parallel, delayed  # pyright: ignore[reportUnknownVariableType]

from bench.blind.outcomes import Opened
from bench.blind.scoring import Oracle
from bridge.results import write_json
from diagnosis.evidence.folder import load_evidence
from diagnosis.fits.baseline import baseline_of
from diagnosis.fits.explanations import Search
from diagnosis.fits.held_out import HeldOut
from diagnosis.gap.prepare import prepare
from diagnosis.gap.problem import Problem
from diagnosis.hypotheses.catalogue import trials
from diagnosis.version import tool_version

Progress = Callable[[str, float], None]
KEPT = "oracle"
_SCORED = ("one-effect", "two-effects")  # kinds of cases whose effects are in the library


def oracle(folder: Path, cases: list[Opened], jobs: int, progress: Progress) -> Oracle:
    """Shrinkage of the true effects, by case, for cases with one or two effects of the library. Raises OSError."""
    by_case: Oracle = {}
    tool = tool_version()
    todo: list[Opened] = []
    for case in cases:
        # a case whose diagnosis ended in a fault would end in the same fault here
        if case.stratum not in _SCORED or case.verdict == "fault":
            continue
        path = folder / KEPT / f"{case.name}.json"
        kept = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
        if kept.get("tool") == tool:
            by_case[case.name] = kept["shrinkage"]
        else:
            todo.append(case)
    tasks = (delayed(_one)(folder / case.name, case.name, sorted(case.truth)) for case in todo)
    done: Any = Parallel(n_jobs=jobs, return_as="generator_unordered")(tasks)
    for number, (name, shrinkage) in enumerate(done, 1):
        by_case[name] = shrinkage
        write_json(folder / KEPT / f"{name}.json", {"shrinkage": shrinkage, "tool": tool})
        progress(f"oracle: {number} of {len(todo)}", number / len(todo))
    return by_case


def _one(folder: Path, name: str, effects: list[str]) -> tuple[str, float | None]:
    shrinkage = shrinkage_with(folder, effects)
    return name, shrinkage if shrinkage is not None and math.isfinite(shrinkage) else None


def shrinkage_with(folder: Path, effects: list[str]) -> float | None:
    """The share of the held-out gap that these effects close; None without a gap or without a trial of an effect.

    Raises Fault where the evidence cannot be read.
    """
    evidence = load_evidence(folder)
    runs = prepare(evidence)
    problem = Problem(evidence.rig, [run for run in runs if not run.holdout])
    names = frozenset(effects)
    tried = [trial for trial in trials(problem) if names.issuperset(trial.hypothesis.effects)]
    search = Search(baseline_of(problem, _no_report), tried, lambda _: 1.0)  # each effect has a reason for a second
    search.run(names, _no_report)
    best = search.of(names)
    if best is None:
        return None
    held_out = Problem(evidence.rig, [run for run in runs if run.holdout])
    return HeldOut(held_out, search.rig, best).closed_by(best).shrinkage


def _no_report(_line: str, _share: float) -> None:
    """Drop the progress within a case: it is reported per case."""
