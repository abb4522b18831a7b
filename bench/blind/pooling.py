"""Kept scores: one file with all inputs of the scores of a set, so that several sets can be scored as one.

A set of hundreds of cases takes hours. Two halves, each opened once and diagnosed by the same version, are worth as much.
"""

import gzip
import json
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple

from bench.blind.locating import LEAST_SHARE, shares
from bench.blind.opening import OpenedSet
from bench.blind.outcomes import Opened
from bench.blind.rivals import Rivals
from bench.blind.scoring import Scores
from bridge.faults import Fault
from bridge.files import read_json

FORMAT: Final = "blind-scores/3"
_BEFORE = "blind-scores/2"  # its results hold a single refit of every effect
_MADE_BY = "take a file that `python -m bench blind score --json` wrote"
_SCORED = ("verdict", "effects", "not_distinguishable", "complete", "numbers", "cpu_s")
_SCORED_OF_GAP = ("shrinkage", "interval_90", "with_effect")


class BlindScores(NamedTuple):
    """Kept scores of sets: every score, and for every case its answer and its result."""

    format: Literal["blind-scores/3"]
    sealed: bool
    tool: str
    methods: dict[str, Scores]
    by_set: dict[str, Scores]  # of the diagnosis
    cases: list[dict[str, Any]]


def kept_scores(opened_set: OpenedSet, methods: dict[str, Scores], by_set: dict[str, Scores]) -> BlindScores:
    """Every score, and the rows of the cases."""
    rows = [_row(opened_set, case) for case in opened_set.cases]
    return BlindScores(FORMAT, opened_set.sealed, opened_set.tool, methods, by_set, rows)


def read_sets(paths: Sequence[Path]) -> dict[str, OpenedSet]:
    """The sets of several files, by file. Raises Fault BAD_SET where a file cannot be read."""
    return {str(path): _read(path) for path in paths}


def _row(opened_set: OpenedSet, case: Opened) -> dict[str, Any]:
    """A case as a readable row, with all inputs of its scores."""
    row = case.row() | {"answer": case.answer, "said": _scored_of(case.diagnosis)}
    if opened_set.oracle is not None:
        row["oracle"] = opened_set.oracle.get(case.name)
    rivals = {method: answers[case.name] for method, answers in opened_set.rivals.items() if case.name in answers}
    return row | {"rivals": rivals}


def _scored_of(raw: Mapping[str, Any]) -> dict[str, Any]:
    """The part of a result that scores depend on."""
    return {key: raw[key] for key in _SCORED if key in raw} | {
        "candidates": [
            {key: candidate.get(key) for key in ("effect", "probability")} for candidate in raw["candidates"]
        ],
        "gap": {key: raw["gap"][key] for key in _SCORED_OF_GAP if key in raw["gap"]},
        "where": [
            {"signal": signal, "regime": regime, "run": run, "share": share}
            for (signal, regime, run), share in shares(raw["where"]).items()
            if share >= LEAST_SHARE
        ],
    }


def _read(path: Path) -> OpenedSet:
    try:
        table = json.loads(gzip.decompress(path.read_bytes())) if path.suffix == ".gz" else read_json(path)
    except (OSError, EOFError, zlib.error) as error:
        reason = getattr(error, "strerror", None) or error
        raise Fault("BAD_SET", f"{path}: cannot be read: {reason}; {_MADE_BY}") from None
    except ValueError as error:
        raise Fault("BAD_SET", f"{path}: is not JSON ({error}); {_MADE_BY}") from None
    made_as = table.get("format") if isinstance(table, dict) else None
    if made_as not in {FORMAT, _BEFORE}:
        raise Fault("BAD_SET", f"{path}: format = {made_as!r}: must be {FORMAT!r}; {_MADE_BY}")
    try:
        rows = table["cases"]
        rivals: Rivals = {}
        for row in rows:
            for method, answer in (row["rivals"] if made_as == FORMAT else {"BIC": lowest_bic(row["said"])}).items():
                rivals.setdefault(method, {})[row["case"]] = answer
        return OpenedSet(
            [Opened(row["case"], row["answer"], row["said"]) for row in rows],
            table["sealed"],
            table["tool"],
            {row["case"]: row["oracle"] for row in rows if row["oracle"] is not None}
            if all("oracle" in row for row in rows)
            else None,
            rivals,
        )
    except (KeyError, TypeError) as error:
        raise Fault("BAD_SET", f"{path}: cases: {error} is missing or has the wrong type; {_MADE_BY}") from None


def lowest_bic(result: Mapping[str, Any]) -> dict[str, float]:
    """Probabilities of none and of single effects by BIC over the refits in a kept result; empty where it has none."""
    from bench.judge.refits import by_bic

    refits = [row for row in result["candidates"] if row["chi2"] is not None]
    return by_bic(
        {row["effect"]: (row["chi2"], len(row["parameters"])) for row in refits}, result.get("compared_features", 0)
    )
