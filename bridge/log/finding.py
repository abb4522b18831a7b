"""A finding: one fault of a log or of evidence, and its place."""

from collections.abc import Iterable
from typing import NamedTuple


class Finding(NamedTuple):
    """Kind, place, text and number of one fault."""

    kind: str  # short and stable: gap, clipped, constant, not-finite, ...
    where: str  # file and column, or topic
    text: str
    times: int = 1  # number of rows, messages or bytes concerned; `text` gives the kind

    def in_words(self) -> str:
        """One line for the operator."""
        return f"{self.kind:<16} {self.where}: {self.text}"


def findings_at(where: str, rows: Iterable[tuple[str, int, str]]) -> list[Finding]:
    """A finding for each row of kind, number and text whose number is not 0."""
    return [Finding(kind, where, text, times) for kind, times, text in rows if times]
