"""From a set, its key and its results to the scores of the diagnosis and of the methods it is compared with."""

from collections.abc import Callable
from pathlib import Path

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


def open_set(folder: Path, key: Path, partial: bool) -> tuple[list[Opened], bool]:
    """Check every hash, open the answers and mark the set; the cases, and whether nobody could know an answer until now.

    Raises Fault SEAL_BROKEN, and BAD_SET for missing results unless `partial`; then nothing was opened.
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
    return cases, mark_opened(folder) and not published


def scored(folder: Path, cases: list[Opened], with_baselines: bool, jobs: int, progress: Progress) -> dict[str, Scores]:
    """Scores by method, the diagnosis first."""
    best: Oracle = oracle(folder, cases, jobs, progress) if with_baselines else {}
    found = {
        TOOL: score(cases, best),
        "parameters": score([baselines.parameters_only(case) for case in cases], best),
        "BIC": score([baselines.lowest_bic(case) for case in cases], best),
        "flexible": score([baselines.flexible_residual(case) for case in cases], best),
    }
    if with_baselines:
        readable = [case.name for case in cases if case.verdict != "fault"]
        guessed = tree_probabilities(folder, readable, jobs, progress)
        found["trees"] = score([baselines.from_probabilities(case, guessed.get(case.name, {})) for case in cases], best)
        found["oracle"] = score([baselines.told(case, best.get(case.name)) for case in cases], best)
    return found
