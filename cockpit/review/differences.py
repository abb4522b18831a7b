"""Parameters of logs by key, and the differences between logs."""

import json
from collections.abc import Mapping
from typing import Any, NamedTuple

from bridge.log.logfile import RunData
from bridge.log.storage.verdict_file import VERDICT


class ParameterDifference(NamedTuple):
    """A parameter with its value in each log; empty if a log lacks it."""

    key: str
    values: list[str]


def parameters_of(run: RunData) -> dict[str, str]:
    """All settings of the processes in a log, by keys such as `controller.limits.v_ratio`."""
    parameters: dict[str, str] = {}
    for role, table in run.headers.items():
        if role == VERDICT:  # a result, not a parameter
            continue
        for name, text in table.items():
            try:
                value = json.loads(text)
            except ValueError:  # plain text, not JSON
                value = text
            _flatten(f"{role}.{name}".replace(".configuration", ""), value, parameters)
    return parameters


def differences(tables: list[Mapping[str, str]]) -> list[ParameterDifference]:
    """Keys whose values differ between the tables, in alphabetical order."""
    keys = sorted({key for table in tables for key in table})
    rows = [ParameterDifference(key, [table.get(key, "") for table in tables]) for key in keys]
    return [row for row in rows if len({*row.values}) > 1]


def _flatten(key: str, value: Any, into: dict[str, str]) -> None:
    if isinstance(value, dict):
        for name, inner in value.items():
            _flatten(f"{key}.{name}", inner, into)
        return
    into[key] = value if isinstance(value, str) else json.dumps(value)
