"""One thing that is wrong with a log or with evidence, told where it is."""

from typing import Any, NamedTuple


class Finding(NamedTuple):
    """What, where, how often, and what it means for the reader."""

    kind: str  # short and stable: gap, clipped, constant, not-finite, ...
    where: str  # file and column, or topic
    text: str
    times: int = 1  # rows, messages or bytes concerned, as `text` says

    def as_dict(self) -> dict[str, Any]:
        """For `--json`."""
        return self._asdict()

    def in_words(self) -> str:
        """One line for a person."""
        return f"{self.kind:<16} {self.where}: {self.text}"
