"""Kept scores: one file with all that the scores of a set are computed from, so that several sets can be scored as one.

A set of hundreds of cases takes hours. Two halves, each opened once and diagnosed by the same version, are worth as much.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from bridge.faults import Fault
from bridge.files import read_json
from diagnosis.blind.locating import LEAST_SHARE, shares
from diagnosis.blind.opening import OpenedSet
from diagnosis.blind.outcomes import Opened
from diagnosis.blind.scoring import Scores, as_json

FORMAT = "blind-scores/2"
_MADE_BY = "take a file that `stickslip blind score --json` wrote"
_SCORED = ("verdict", "effects", "not_distinguishable", "compared_features", "elapsed_s")
_SCORED_OF_GAP = ("shrinkage", "interval_90", "retuned", "with_effect", "compared")


def kept_scores(found: OpenedSet, methods: dict[str, Scores]) -> dict[str, Any]:
    """Every score, and for every case its answer and its result: what `pooled` reads."""
    about = {"format": FORMAT, "sealed": found.sealed, "tool": found.tool, "methods": as_json(methods)}
    return about | {"cases": [_row(found, case) for case in found.cases]}


def pooled(paths: Sequence[Path]) -> OpenedSet:
    """The cases of several files as one set.

    Raises Fault BAD_SET where a file cannot be read, versions differ, or a case is in two files.
    """
    found = [_read(path) for path in paths]
    tools = {one.tool for one in found}
    if len(tools) > 1:
        files = ", ".join(map(str, paths))
        line = f"{files}: results of the versions {' and '.join(sorted(tools))}: must be of one;"
        raise Fault("BAD_SET", f"{line} score each for itself")
    seen: dict[int, Path] = {}  # by the seed of a case, as the same case of another making has another name
    for path, one in zip(paths, found, strict=True):
        for case in one.cases:
            if (other := seen.setdefault(case.answer["counterfactual_seed"], path)) is not path:
                line = f"{path}: case {case.name} is in {other} too: must be in one; leave one file out"
                raise Fault("BAD_SET", line)
    asked = all(one.oracle is not None and one.trees is not None for one in found)
    return OpenedSet(
        [case for one in found for case in one.cases],
        all(one.sealed for one in found),
        found[0].tool,
        {name: closed for one in found for name, closed in (one.oracle or {}).items()} if asked else None,
        {name: said for one in found for name, said in (one.trees or {}).items()} if asked else None,
    )


def _row(found: OpenedSet, case: Opened) -> dict[str, Any]:
    """A case as a row for a person, with all that its scores are computed from."""
    row = case.row() | {"answer": case.answer, "said": _scored_of(case.said)}
    if found.oracle is not None:
        row["oracle"] = found.oracle.get(case.name)
    if found.trees is not None:
        row["trees"] = found.trees.get(case.name)
    return row


def _scored_of(said: Mapping[str, Any]) -> dict[str, Any]:
    """The part of a result that scores depend on."""
    return {key: said[key] for key in _SCORED if key in said} | {
        "candidates": [
            {key: one.get(key) for key in ("effect", "probability", "chi2")}
            | {"parameters": list(one.get("parameters", ()))}
            for one in said["candidates"]
        ],
        "gap": {key: said["gap"][key] for key in _SCORED_OF_GAP if key in said["gap"]},
        "next_experiment": {key: said["next_experiment"][key] for key in ("gain",) if key in said["next_experiment"]},
        "where": [
            {"signal": signal, "regime": regime, "run": run, "share": share}
            for (signal, regime, run), share in shares(said["where"]).items()
            if share >= LEAST_SHARE
        ],
    }


def _read(path: Path) -> OpenedSet:
    try:
        table = read_json(path)
    except OSError as error:
        raise Fault("BAD_SET", f"{path}: cannot be read: {error.strerror}; {_MADE_BY}") from None
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
            *(
                {row["case"]: row[key] for row in rows if row[key] is not None}
                if all(key in row for row in rows)
                else None
                for key in ("oracle", "trees")
            ),
        )
    except (KeyError, TypeError) as error:
        raise Fault("BAD_SET", f"{path}: cases: {error} is missing or not what it should be; {_MADE_BY}") from None
