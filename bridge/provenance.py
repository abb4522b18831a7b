"""What made a page or a picture: version, command line, date, and the SHA-256 of each file that it shows."""

import hashlib
import html
import os
import re
import shlex
from collections.abc import Iterable, Sequence
from contextvars import ContextVar
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from bridge.plain import plain

# the words after `stickslip` of the command that runs; None where the functions are called without one
COMMAND: ContextVar[Sequence[str] | None] = ContextVar("command", default=None)
_SHOWN_DIGITS = 12  # of a hash in a line for a person; the metadata of a picture have all 64
_EPOCH = "SOURCE_DATE_EPOCH"  # https://reproducible-builds.org/specs/source-date-epoch


class Input(NamedTuple):
    """A file that a page or a picture shows; `sha256` is what `sha256sum` prints."""

    name: str
    sha256: str


class Provenance(NamedTuple):
    """What made a page or a picture."""

    version: str
    command: str  # as it was typed; empty where there was none
    date: datetime  # UTC, whole seconds
    inputs: list[Input]

    @property
    def date_text(self) -> str:
        """`2026-03-01 12:00:00 UTC`."""
        return f"{self.date:%Y-%m-%d %H:%M:%S} UTC"

    def in_words(self) -> str:
        """One line for the foot of a page or a picture."""
        files = [f"{one.name} (SHA-256 {one.sha256[:_SHOWN_DIGITS]}...)" for one in self.inputs]
        made = f"stickslip {self.version}, {self.date_text}"
        return "; ".join([made, *([self.command] if self.command else []), *files])

    def footer(self) -> str:
        """The foot of a page, as HTML: the line, and each file with its whole hash."""
        line = f"Made by stickslip {self.version}, {self.date_text}"
        if self.command:
            line += f": <code>{html.escape(self.command)}</code>"
        files = "".join(f"<br>{html.escape(one.name)}: SHA-256 <code>{one.sha256}</code>" for one in self.inputs)
        style = (
            "margin-top: 2em; border-top: 1px solid #d5d8dc; font-size: 0.85em; color: #566573; overflow-wrap: anywhere"
        )
        return f'<footer style="{style}">{line}.{files}</footer>'

    def whole(self) -> str:
        """The same with whole hashes, for metadata."""
        parts = [*([self.command] if self.command else []), *(f"{one.name} sha256:{one.sha256}" for one in self.inputs)]
        return "; ".join(parts)

    def metadata(self, suffix: str, title: str) -> dict[str, str | datetime]:
        """For `savefig` of matplotlib; `suffix` is .png, .svg or .pdf."""
        made_by = f"stickslip {self.version}"
        if suffix == ".pdf":
            return {"Title": title, "Creator": made_by, "Subject": self.whole(), "CreationDate": self.date}
        if suffix == ".svg":
            return {"Title": title, "Creator": made_by, "Description": self.whole(), "Date": self.date.isoformat()}
        return {
            "Title": title,
            "Software": made_by,
            "Description": self.whole(),
            "Creation Time": self.date.isoformat(),
        }


def provenance(inputs: Iterable[Path] = ()) -> Provenance:
    """What makes a page or a picture of these files now; the date is that of SOURCE_DATE_EPOCH where it is set.

    Raises OSError where a file cannot be read.
    """
    # 20 ms that a command without a page or a picture does not need
    from importlib.metadata import PackageNotFoundError, version  # noqa: PLC0415

    try:
        number = version("stickslip")
    except PackageNotFoundError:
        number = "unknown"
    words = COMMAND.get()
    command = "" if words is None else shown_name(shlex.join(["stickslip", *words]))
    files = [Input(shown_name(path.name), _sha256(path)) for path in dict.fromkeys(inputs)]
    return Provenance(number, command, _now(), files)


def shown_name(text: str) -> str:
    """A name or a command without bytes that are not UTF-8 and without control characters, which an SVG cannot hold."""
    return plain(os.fsencode(text).decode(errors="backslashreplace"))


def _now() -> datetime:
    seconds = os.environ.get(_EPOCH, "")
    if re.fullmatch(r"[0-9]{1,11}", seconds):  # with more digits it is no date
        return datetime.fromtimestamp(int(seconds), UTC)
    return datetime.now(UTC).replace(microsecond=0)


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
