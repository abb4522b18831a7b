"""From sets, their keys and their results to the scores of the diagnosis and of its rivals."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

from bench.blind.oracle import oracle
from bench.blind.outcomes import Opened, opened
from bench.blind.rivals import Rivals, answered, ask_rivals
from bench.blind.running import missing, results
from bench.blind.scoring import Oracle, Scores, score
from bench.blind.sealing import SET, mark_opened, opened_answers
from bench.blind.table import TOOL
from bridge.faults import Fault

Progress = Callable[[str, float], None]


class OpenedSet(NamedTuple):
    """The opened cases of a set, and the other inputs of its scores."""

    cases: list[Opened]
    sealed: bool  # True if no answer was known when the results were made
    tool: str  # version of the diagnosis that made the results
    oracle: Oracle | None = None  # share of the gap that the true effects close, by case; None: not computed
    rivals: Rivals = {}


def sets_of(folder: Path) -> dict[str, Path]:
    """The set in this folder, or all sets in folders of it, by name."""
    inside = {path.parent.name: path.parent for path in sorted(folder.glob(f"*/{SET}"))}
    return {folder.name: folder} if (folder / SET).is_file() or not inside else inside


def open_sets(folder: Path, key: Path, partial: bool) -> dict[str, OpenedSet]:
    """Check every hash, open the answers and mark the sets; the keys of several sets are KEY/<set>.key.

    Raises Fault SEAL_BROKEN for a wrong hash, and BAD_SET for missing results unless `partial`; then all sets stay unopened.
    """
    sets = sets_of(folder)
    keys = {name: key if path == folder else key / f"{name}.key" for name, path in sets.items()}
    checked = {name: _checked(path, keys[name], partial) for name, path in sets.items()}
    return {name: part._replace(sealed=mark_opened(sets[name]) and part.sealed) for name, part in checked.items()}


def _checked(folder: Path, key: Path, partial: bool) -> OpenedSet:
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
    return OpenedSet(cases, not published, tool)


def compared(
    opened_set: OpenedSet, folder: Path, rivals: list[str], ask_oracle: bool, jobs: int, progress: Progress
) -> OpenedSet:
    """The set with the answers of rivals, and of the oracle, which needs its own computation."""
    opened_set = opened_set._replace(rivals=ask_rivals(folder, rivals, jobs, progress))
    return opened_set._replace(oracle=oracle(folder, opened_set.cases, jobs, progress)) if ask_oracle else opened_set


def together(sets: Mapping[str, OpenedSet]) -> OpenedSet:
    """All cases as one set. Raises Fault BAD_SET where versions differ or a case is in two of the sets."""
    tools = {part.tool for part in sets.values()}
    if len(tools) > 1:
        line = f"{', '.join(sets)}: results of the versions {' and '.join(sorted(tools))}: must be of one;"
        raise Fault("BAD_SET", f"{line} score each for itself")
    seen: dict[int, str] = {}  # by the seed of a case, as a case that was made a second time has another name
    for name, part in sets.items():
        for case in part.cases:
            if (other := seen.setdefault(case.answer["counterfactual_seed"], name)) != name:
                raise Fault("BAD_SET", f"{name}: case {case.name} is in {other} too: must be in one; leave one out")
    asked = all(part.oracle is not None for part in sets.values())
    methods = dict.fromkeys(method for part in sets.values() for method in part.rivals)
    return OpenedSet(
        [case for part in sets.values() for case in part.cases],
        all(part.sealed for part in sets.values()),
        tools.pop(),
        {name: closed for part in sets.values() for name, closed in (part.oracle or {}).items()} if asked else None,
        {
            method: {name: answer for part in sets.values() for name, answer in part.rivals.get(method, {}).items()}
            for method in methods
        },
    )


def scored(opened_set: OpenedSet) -> dict[str, Scores]:
    """Scores by method, the diagnosis first; a rival is scored over the cases that it answered."""
    cases, best = opened_set.cases, opened_set.oracle or {}
    others = {
        method: [answered(case, answers[case.name]) for case in cases if case.name in answers]
        for method, answers in opened_set.rivals.items()
    }
    return {name: score(chosen, best) for name, chosen in ({TOOL: cases} | others).items()}
