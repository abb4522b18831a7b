"""A finding: one fault of a log or of evidence, and its place."""

from typing import Any, NamedTuple


class Finding(NamedTuple):
    """Kind, place, text and number of one fault."""

    kind: str  # short and stable: gap, clipped, constant, not-finite, ...
    where: str  # file and column, or topic
    text: str
    times: int = 1  # number of rows, messages or bytes concerned; `text` gives the kind

    def as_dict(self) -> dict[str, Any]:
        """The finding as an object for `--json`."""
        return self._asdict()

    def in_words(self) -> str:
        """One line for the operator."""
        return f"{self.kind:<16} {self.where}: {self.text}"
