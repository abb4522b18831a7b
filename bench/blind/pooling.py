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
from bench.blind.scoring import Scores
from bridge.faults import Fault
from bridge.files import read_json

FORMAT: Final = "blind-scores/2"
_MADE_BY = "take a file that `python -m bench blind score --json` wrote"
_SCORED = ("verdict", "effects", "not_distinguishable", "compared_features", "elapsed_s")
_SCORED_OF_GAP = ("shrinkage", "interval_90", "retuned", "with_effect", "compared")


class BlindScores(NamedTuple):
    """Kept scores of one set: every score, and for every case its answer and its result."""

    format: Literal["blind-scores/2"]
    sealed: bool
    tool: str
    methods: dict[str, Scores]
    cases: list[dict[str, Any]]


def kept_scores(opened_set: OpenedSet, methods: dict[str, Scores]) -> BlindScores:
    """Every score, and the rows of the cases."""
    rows = [_row(opened_set, case) for case in opened_set.cases]
    return BlindScores(FORMAT, opened_set.sealed, opened_set.tool, methods, rows)


def pooled(paths: Sequence[Path]) -> OpenedSet:
    """The cases of several files as one set.

    Raises Fault BAD_SET where a file cannot be read, versions differ, or a case is in two files.
    """
    sets = [_read(path) for path in paths]
    tools = {opened_set.tool for opened_set in sets}
    if len(tools) > 1:
        files = ", ".join(map(str, paths))
        line = f"{files}: results of the versions {' and '.join(sorted(tools))}: must be of one;"
        raise Fault("BAD_SET", f"{line} score each for itself")
    seen: dict[int, Path] = {}  # by the seed of a case, as a case that was made a second time has another name
    for path, opened_set in zip(paths, sets, strict=True):
        for case in opened_set.cases:
            if (other := seen.setdefault(case.answer["counterfactual_seed"], path)) is not path:
                line = f"{path}: case {case.name} is in {other} too: must be in one; leave one file out"
                raise Fault("BAD_SET", line)
    asked = all(opened_set.oracle is not None for opened_set in sets)
    return OpenedSet(
        [case for opened_set in sets for case in opened_set.cases],
        all(opened_set.sealed for opened_set in sets),
        sets[0].tool,
        {name: closed for opened_set in sets for name, closed in (opened_set.oracle or {}).items()} if asked else None,
    )


def _row(opened_set: OpenedSet, case: Opened) -> dict[str, Any]:
    """A case as a readable row, with all inputs of its scores."""
    row = case.row() | {"answer": case.answer, "said": _scored_of(case.diagnosis)}
    if opened_set.oracle is not None:
        row["oracle"] = opened_set.oracle.get(case.name)
    return row


def _scored_of(raw: Mapping[str, Any]) -> dict[str, Any]:
    """The part of a result that scores depend on."""
    return {key: raw[key] for key in _SCORED if key in raw} | {
        "candidates": [
            {key: candidate.get(key) for key in ("effect", "probability", "chi2")}
            | {"parameters": list(candidate.get("parameters", ()))}
            for candidate in raw["candidates"]
        ],
        "gap": {key: raw["gap"][key] for key in _SCORED_OF_GAP if key in raw["gap"]},
        "next_experiment": {key: raw["next_experiment"][key] for key in ("gain",) if key in raw["next_experiment"]},
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
    if made_as != FORMAT:
        raise Fault("BAD_SET", f"{path}: format = {made_as!r}: must be {FORMAT!r}; {_MADE_BY}")
    try:
        rows = table["cases"]
        return OpenedSet(
            [Opened(row["case"], row["answer"], row["said"]) for row in rows],
            table["sealed"],
            table["tool"],
            {row["case"]: row["oracle"] for row in rows if row["oracle"] is not None}
            if all("oracle" in row for row in rows)
            else None,
        )
    except (KeyError, TypeError) as error:
        raise Fault("BAD_SET", f"{path}: cases: {error} is missing or has the wrong type; {_MADE_BY}") from None
