"""From a set, its key and its results to the scores of the diagnosis and of the methods for comparison."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from bench.blind import baselines
from bench.blind.oracle import oracle
from bench.blind.outcomes import Opened, opened
from bench.blind.running import missing, results
from bench.blind.scoring import Oracle, Scores, score
from bench.blind.sealing import mark_opened, opened_answers
from bench.blind.table import TOOL
from bridge.faults import Fault

Progress = Callable[[str, float], None]


class OpenedSet(NamedTuple):
    """The opened cases of a set, and the other inputs of its scores."""

    cases: list[Opened]
    sealed: bool  # True if no answer was known when the results were made
    tool: str  # version of the diagnosis that made the results
    oracle: Oracle | None = None  # share of the gap that the true effects close, by case; None: not computed


def open_set(folder: Path, key: Path, partial: bool) -> OpenedSet:
    """Check every hash, open the answers and mark the set.

    Raises Fault SEAL_BROKEN for a wrong hash, and BAD_SET for missing results unless `partial`; a set that raises stays unopened.
    """
    answers = opened_answers(folder, key)
    left = missing(folder)
    if len(left) == len(answers) or (left and not partial):
        names = ", ".join(left[:3]) + (", ..." if len(left) > 3 else "")
        line = f"{folder}: {len(left)} of {len(answers)} cases have no result: {names}; `python -m bench blind run {folder}`"
        raise Fault("BAD_SET", line + " makes them" + ("" if partial else ", --partial scores without them"))
    outcomes = results(folder, list(answers))
    cases = [opened(name, answers[name], result) for name, result in outcomes.items()]
    published = any(answer.get("published", True) for answer in answers.values())
    # `blind run` makes results of one version only
    tool = str(next(iter(outcomes.values())).get("tool", "unknown"))
    return OpenedSet(cases, mark_opened(folder) and not published, tool)


def with_oracle(opened_set: OpenedSet, folder: Path, jobs: int, progress: Progress) -> OpenedSet:
    """The set with the answers of the oracle, which needs its own computation."""
    return opened_set._replace(oracle=oracle(folder, opened_set.cases, jobs, progress))


def scored(opened_set: OpenedSet) -> dict[str, Scores]:
    """Scores by method, the diagnosis first."""
    cases, best = opened_set.cases, opened_set.oracle
    methods = {
        TOOL: cases,
        "parameters": [baselines.parameters_only(case) for case in cases],
        "BIC": [baselines.lowest_bic(case) for case in cases],
    }
    if best is not None:
        methods["oracle"] = [baselines.told(case, best.get(case.name)) for case in cases]
    return {name: score(answers, best or {}) for name, answers in methods.items()}
