"""From a set, its key and its results to the scores of the diagnosis and of the methods for comparison."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from bridge.faults import Fault
from diagnosis.blind import baselines
from diagnosis.blind.oracle import oracle
from diagnosis.blind.outcomes import Opened, opened
from diagnosis.blind.running import missing, results
from diagnosis.blind.scoring import Oracle, Scores, score
from diagnosis.blind.sealing import mark_opened, opened_answers
from diagnosis.blind.table import TOOL
from diagnosis.blind.trees import tree_probabilities

Progress = Callable[[str, float], None]


class OpenedSet(NamedTuple):
    """The opened cases of a set, and all else that its scores need."""

    cases: list[Opened]
    sealed: bool  # whether nobody could know an answer when the results were made
    tool: str  # version that made the results
    oracle: Oracle | None = None  # None: not computed
    trees: dict[str, dict[str, float]] | None = None  # probabilities of the candidates, by case; None: not computed


def open_set(folder: Path, key: Path, partial: bool) -> OpenedSet:
    """Check every hash, open the answers and mark the set.

    Raises Fault SEAL_BROKEN for a wrong hash, and BAD_SET for missing results unless `partial`; a set that raises stays unopened.
    """
    answers = opened_answers(folder, key)
    left = missing(folder)
    if len(left) == len(answers) or (left and not partial):
        some = ", ".join(left[:3]) + (", ..." if len(left) > 3 else "")
        line = f"{folder}: {len(left)} of {len(answers)} cases have no result: {some}; `stickslip blind run {folder}`"
        raise Fault("BAD_SET", line + " makes them" + ("" if partial else ", --partial scores without them"))
    said = results(folder, list(answers))
    cases = [opened(name, answers[name], result) for name, result in said.items()]
    published = any(answer.get("published", True) for answer in answers.values())
    # `blind run` makes results of one version only
    tool = str(next(iter(said.values())).get("tool", "unknown"))
    return OpenedSet(cases, mark_opened(folder) and not published, tool)


def with_baselines(found: OpenedSet, folder: Path, jobs: int, progress: Progress) -> OpenedSet:
    """The set with the answers of the two methods that need their own computation: oracle and trees."""
    best = oracle(folder, found.cases, jobs, progress)
    readable = [case.name for case in found.cases if case.verdict != "fault"]
    return found._replace(oracle=best, trees=tree_probabilities(folder, readable, jobs, progress))


def scored(found: OpenedSet) -> dict[str, Scores]:
    """Scores by method, the diagnosis first."""
    cases, best, guessed = found.cases, found.oracle, found.trees
    methods = {
        TOOL: cases,
        "parameters": [baselines.parameters_only(case) for case in cases],
        "BIC": [baselines.lowest_bic(case) for case in cases],
        "flexible": [baselines.flexible_residual(case) for case in cases],
    }
    if guessed is not None:
        methods["trees"] = [baselines.from_probabilities(case, guessed.get(case.name, {})) for case in cases]
    if best is not None:
        methods["oracle"] = [baselines.told(case, best.get(case.name)) for case in cases]
    return {name: score(answers, best or {}) for name, answers in methods.items()}
