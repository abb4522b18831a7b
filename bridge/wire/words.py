"""The meaning of codes in a log: modes, contact states, reasons, limits, guard states and causes, from `stickslip.proto`."""

import functools
import re
from pathlib import Path
from typing import NamedTuple

# severity, in the letters of NAMUR NE 107
FAILURE, CHECK, OUTSIDE, MAINTENANCE, NEWS = "F", "C", "S", "M", ""
SEVERITIES = {
    FAILURE: "failure",
    CHECK: "check",
    OUTSIDE: "out of specification",
    MAINTENANCE: "maintenance",
    NEWS: "news",
}
_COLUMNS = {
    "Mode": "mode",
    "ContactState": "state",
    "Reason": "reason",
    "Limit": "limit",
    "GuardState": "guard_state",
    "Cause": "cause",
}  # column of a log by the enum of its codes


class ColumnWord(NamedTuple):
    """A code in a column of a log, such as `reason` of /trace."""

    column: str
    number: int
    word: str
    help: str


@functools.cache
def source() -> str:
    """The text of `stickslip.proto`, whose comments explain all codes."""
    return Path(__file__).with_name("stickslip.proto").read_text(encoding="utf-8")


@functools.cache
def words() -> tuple[ColumnWord, ...]:
    """All codes, by column and number; `help` is the comment of the code in `stickslip.proto`, with its severity as a word."""
    result: list[ColumnWord] = []
    for enum, column in _COLUMNS.items():
        body = re.findall(rf"^enum {enum} {{\n(.*?)^}}", source(), re.MULTILINE | re.DOTALL)[0]
        rows = re.findall(r"(\w+) = (\d+); +// (.+)", body)
        result += [ColumnWord(column, int(number), word, _spelt_out(comment)) for word, number, comment in rows]
    return tuple(result)


def word_of(column: str, number: int) -> str:
    """Word of a number in a column; the number itself if this version does not know it."""
    return next((row.word for row in words() if (row.column, row.number) == (column, number)), str(number))


def help_of(column: str, word: str) -> str:
    """Meaning of a word in a column."""
    return next((row.help for row in words() if (row.column, row.word) == (column, word)), "not known to this version")


def _spelt_out(comment: str) -> str:
    letter, colon, meaning = comment.partition(": ")
    return f"{SEVERITIES[letter]}: {meaning}" if colon and letter in SEVERITIES else comment
