"""Every kind of fault: its targets, the meaning of its value, and its default; `kinds.toml` lists them."""

import math
import tomllib
from pathlib import Path
from typing import Any, NamedTuple

from bridge.wire.channels import CHANNELS

SENSORS, EXCITER, CLOCK, BUS, PROCESS = "sensors", "exciter", "clock", "bus", "process"
ALL_SENSORS = "sensors"
LINK = "link"  # both directions
LARGEST = 3.4e38  # largest sample on the wire, a 32-bit float
# targets by group
TARGETS = {
    SENSORS: (*CHANNELS, ALL_SENSORS),
    EXCITER: ("exciter",),
    CLOCK: ("clock",),
    BUS: ("blocks", "commands", LINK),
    PROCESS: ("controller", "plant", "recorder"),
}
_GROUPS = {target: group for group, targets in TARGETS.items() for target in targets}


class InjectionKind(NamedTuple):
    """One kind of fault."""

    group: str
    kind: str
    help: str
    value: str = ""  # meaning of the value, with its unit; empty for a kind without value
    default: float | None = None  # None for a kind without value, or if it must be given
    lowest: float = -math.inf  # limits of the value
    highest: float = math.inf


_TABLE: dict[str, dict[str, dict[str, Any]]] = tomllib.loads(
    Path(__file__).with_name("kinds.toml").read_text(encoding="utf-8")
)
KINDS = {
    (group, kind): InjectionKind(group, kind, **row) for group, rows in _TABLE.items() for kind, row in rows.items()
}


def group_of(target: str) -> str | None:
    """The group of a target; None for an unknown target."""
    return _GROUPS.get(target)
