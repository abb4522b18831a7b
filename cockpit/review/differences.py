"""Parameters of logs by their keys, and those of two logs that are not the same."""

import json
from collections.abc import Mapping
from typing import Any, NamedTuple

from bridge.log.logfile import RunData
from cockpit.judge.verdict_words import VERDICT


class Difference(NamedTuple):
    """A parameter with its value in each log; empty where a log has none."""

    key: str
    values: list[str]


def parameters_of(run: RunData) -> dict[str, str]:
    """Every number and word that a log holds of its processes, by a key such as `controller.limits.v_ratio`."""
    found: dict[str, str] = {}
    for role, table in run.headers.items():
        if role == VERDICT:  # what came of the run is no parameter of it
            continue
        for name, text in table.items():
            try:
                value = json.loads(text)
            except ValueError:  # a text as it is
                value = text
            _flatten(f"{role}.{name}".replace(".configuration", ""), value, found)
    return found


def differences(tables: list[Mapping[str, str]]) -> list[Difference]:
    """The keys whose values are not the same in all tables, in the order of their names."""
    keys = sorted({key for table in tables for key in table})
    rows = [Difference(key, [table.get(key, "") for table in tables]) for key in keys]
    return [row for row in rows if len({*row.values}) > 1]


def _flatten(key: str, value: Any, into: dict[str, str]) -> None:
    if isinstance(value, dict):
        for name, inner in value.items():
            _flatten(f"{key}.{name}", inner, into)
        return
    into[key] = value if isinstance(value, str) else json.dumps(value)
