"""What the numbers of a log mean: modes, states of the contact, reasons and limits, in the words of `stickslip.proto`."""

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


class Word(NamedTuple):
    """A number of a column of /trace, /command and /state."""

    column: str
    number: int
    word: str
    help: str


def words() -> list[Word]:
    """Every word, by column and number; `help` is the comment beside the word in `stickslip.proto`."""
    proto = Path(__file__).with_name("stickslip.proto").read_text(encoding="utf-8")
    found: list[Word] = []
    for enum, column in _COLUMNS.items():
        body = re.findall(rf"^enum {enum} {{\n(.*?)^}}", proto, re.MULTILINE | re.DOTALL)[0]
        rows = re.findall(r"(\w+) = (\d+); +// (.+)", body)
        found += [Word(column, int(number), word, told) for word, number, told in rows]
    return found
