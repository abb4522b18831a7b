"""Configurations and versions that the processes of a run wrote into its log: JSON that may be damaged or altered."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bridge.faults import Fault

Metadata = Mapping[str, Mapping[str, str]]  # the tables of a log by name, each with texts by key


def table_of(metadata: Metadata, name: str, key: str, path: Path) -> dict[str, Any]:
    """The JSON object under `key` of the table `name`. Raises Fault BAD_LOG for a log without it."""
    text = metadata.get(name, {}).get(key)
    if text is None:
        line = (
            f"{path}: holds no {key} of the {name}; it was not written during the recording, or a tool removed it later"
        )
        if "import" in metadata:
            line = f"{path}: is imported data of another program, without a {name}: it holds no run to judge"
        reads = "`log info`, `log check`, `log export`, `plot`" if "import" in metadata else "`log check`, `log export`"
        remedy = f"{reads} and `look` read it, and `diagnose` in an evidence folder"
        raise Fault("BAD_LOG", f"{line}; {remedy}")
    table = _parsed(text, f"{path}: the {key} of the {name}")
    if not isinstance(table, dict):
        line = f"{path}: the {key} of the {name}: must be a JSON object"
        raise Fault("BAD_LOG", f"{line}; take another copy of the log")
    return table


def texts_of(metadata: Metadata, name: str, key: str, path: Path) -> list[str]:
    """The JSON list of texts under `key` of the table `name`, empty if absent. Raises Fault BAD_LOG."""
    where = f"{path}: the {key} of the {name}"
    values = _parsed(metadata.get(name, {}).get(key, "[]"), where)
    if not isinstance(values, list) or not all(isinstance(value, str) for value in values):
        raise Fault("BAD_LOG", f"{where}: must be a list of texts; take another copy of the log")
    return values


def source_of_import(metadata: Metadata, path: Path) -> str:
    """The source file of an imported log; empty for the log of a run. Raises Fault BAD_LOG."""
    if "import" not in metadata:
        return ""
    source = _parsed(metadata["import"].get("source", '"another program"'), f"{path}: the source of the import")
    return source if isinstance(source, str) and source else "another program"


def _parsed(text: str, where: str) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError):  # also Python's own limits: integers of 4300 digits, brackets 1000 deep
        raise Fault("BAD_LOG", f"{where} is damaged, not JSON; take another copy of the log") from None


def configuration_of(metadata: Metadata, role: str, path: Path) -> dict[str, Any]:
    """The configuration of a process, every default included. Raises Fault BAD_LOG when the log has none."""
    return table_of(metadata, role, "configuration", path)


def number_of(controller: Mapping[str, Any], key: str, path: Path) -> float:
    """A number at `key`, as in `policy.enabled_from_s`, of the controller's configuration. Raises Fault BAD_LOG."""
    value = value_at(controller, key)
    least, rule = (0.0, "a positive number") if key == "block_s" else (-math.inf, "a number")
    if not is_number(value) or value <= least:
        line = f"{path}: configuration of the controller: must hold {key} as {rule}"
        raise Fault("BAD_LOG", f"{line}; see bridge/wire/PROTOCOL.md, Header")
    return float(value)


def value_at(table: Any, key: str) -> Any:
    """The value at `key`, as in `rig.drive.stiffness_N_per_m`, of nested tables of JSON; None if it is absent."""
    for part in key.split("."):
        table = table.get(part) if isinstance(table, Mapping) else None
    return table


def is_number(value: Any) -> bool:
    """Whether a value of JSON is a finite number that a float can hold."""
    try:
        return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    except OverflowError:  # an integer of more than 308 digits
        return False
