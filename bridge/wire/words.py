"""The meaning of codes in a log: modes, contact states, reasons, limits, guard states and causes, from `stickslip.proto`."""

import re
from pathlib import Path
from typing import NamedTuple

_COLUMNS = {
    "Mode": "mode",
    "ContactState": "state",
    "Reason": "reason",
    "Limit": "limit",
    "GuardState": "guard_state",
    "Cause": "cause",
}  # by enum


class ColumnWord(NamedTuple):
    """A code in a column of a log, such as `reason` of /trace."""

    column: str
    number: int
    word: str
    help: str


def words() -> list[ColumnWord]:
    """All codes, by column and number; `help` is the comment of the code in `stickslip.proto`."""
    proto = Path(__file__).with_name("stickslip.proto").read_text(encoding="utf-8")
    result: list[ColumnWord] = []
    for enum, column in _COLUMNS.items():
        body = re.findall(rf"^enum {enum} {{\n(.*?)^}}", proto, re.MULTILINE | re.DOTALL)[0]
        rows = re.findall(r"(\w+) = (\d+); +// (.+)", body)
        result += [ColumnWord(column, int(number), word, comment) for word, number, comment in rows]
    return result
