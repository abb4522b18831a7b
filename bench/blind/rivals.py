"""Methods of `python -m bench judge` on the cases of a set: they see the evidence alone, and their answers are kept with it."""

from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from bench.blind.outcomes import Opened, opened
from bench.blind.sealing import read_set

Progress = Callable[[str, float], None]
Answer = dict[str, float]  # probabilities of effects, none and `outside`; and `cpu_s`
Rivals = dict[str, dict[str, Answer]]  # by method and case
_HALF = 0.5
_NAMED = 0.25  # probability from which a name counts, two names at most, as in `bench/judge/scoring.py`


def ask_rivals(folder: Path, names: list[str], jobs: int, progress: Progress) -> Rivals:
    """Answers of these methods to all cases; kept answers of the same code are read. A case without kept data is left out.

    Raises Fault BAD_SET, and CONFIG for an unknown method.
    """
    from bench.judge.cases import Case
    from bench.judge.methods import NOT_KEPT, ask, known

    known(names)
    cases = [
        Case(name, folder.name, "none", frozenset(), None, None, hashes.evidence_sha256, {}, folder / name)
        for name, hashes in read_set(folder).items()
    ]
    answers: Rivals = {name: {} for name in names}
    for done, given in enumerate(ask(folder, names, cases, jobs, None) if names else (), 1):
        if given.fault != NOT_KEPT:
            answers[given.method][given.case] = given.probabilities | {"cpu_s": given.cpu_s or 0.0}
        progress(f"{given.method}: {given.case}", done / (len(cases) * len(names)))
    return answers


def answered(case: Opened, answer: Mapping[str, float]) -> Opened:
    """The answer as a result: it is `unexplained` where outside has half, and names one or two effects."""
    shares: Counter[str] = Counter()
    for name, share in answer.items():
        if name not in {"outside", "cpu_s"}:
            shares.update(dict.fromkeys(name.split(" + "), share))
    ranked = shares.most_common()
    if not ranked:
        return opened(case.name, case.answer, {"fault": "NO_ANSWER"})
    (first, most), outside = ranked[0], answer.get("outside", 0.0)
    effects = [name for name, share in ranked[:2] if name != "none" and share >= _NAMED]
    verdict = "effect" if most >= _HALF else "partly"  # without a share, partly counts as outside
    if outside >= _HALF:
        verdict = "unexplained"
    elif first == "none":
        verdict = "no-gap"
    result: dict[str, Any] = {
        "verdict": verdict,
        "effects": effects if verdict in {"effect", "partly"} else [],
        "candidates": [{"effect": name, "probability": share} for name, share in ranked],
        "complete": 1.0 - outside,
        "cpu_s": answer.get("cpu_s"),
    }
    return opened(case.name, case.answer, result)
