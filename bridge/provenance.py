"""The origin of a page or a picture: version, command line, date, and the SHA-256 of each input file."""

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

# arguments of the running `stickslip` command; None if the functions are called without a command
COMMAND: ContextVar[Sequence[str] | None] = ContextVar("command", default=None)
_SHOWN_DIGITS = 12  # digits of a hash in visible text; the metadata of a picture hold all 64
_EPOCH = "SOURCE_DATE_EPOCH"  # https://reproducible-builds.org/specs/source-date-epoch


class Input(NamedTuple):
    """An input file of a page or a picture; `sha256` in hexadecimal, as `sha256sum` prints it."""

    name: str
    sha256: str


class Provenance(NamedTuple):
    """The origin of a page or a picture."""

    version: str
    command: str  # the command line; empty without a command
    date: datetime  # UTC, whole seconds
    inputs: list[Input]

    @property
    def date_text(self) -> str:
        """The date as text: `2026-03-01 12:00:00 UTC`."""
        return f"{self.date:%Y-%m-%d %H:%M:%S} UTC"

    def in_words(self) -> str:
        """One line for the foot of a page or a picture."""
        files = [f"{file.name} (SHA-256 {file.sha256[:_SHOWN_DIGITS]}...)" for file in self.inputs]
        made = f"stickslip {self.version}, {self.date_text}"
        return "; ".join([made, *([self.command] if self.command else []), *files])

    def footer(self) -> str:
        """The foot of a page, as HTML: the line, and each file with its whole hash."""
        line = f"Made by stickslip {self.version}, {self.date_text}"
        if self.command:
            line += f": <code>{html.escape(self.command)}</code>"
        files = "".join(f"<br>{html.escape(file.name)}: SHA-256 <code>{file.sha256}</code>" for file in self.inputs)
        return f"<footer>{line}.{files}</footer>"

    def whole(self) -> str:
        """Command and files with whole hashes, for metadata."""
        parts = [
            *([self.command] if self.command else []),
            *(f"{file.name} sha256:{file.sha256}" for file in self.inputs),
        ]
        return "; ".join(parts)

    def metadata(self, suffix: str, title: str) -> dict[str, str | datetime]:
        """The metadata of a picture for matplotlib's `savefig`; `suffix` is .png, .svg or .pdf."""
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
    """The origin of a page or a picture made now from these files; SOURCE_DATE_EPOCH overrides the date.

    Raises OSError if a file cannot be read.
    """
    # imported here: 20 ms, which a command without a page or a picture saves
    from importlib.metadata import PackageNotFoundError, version  # noqa: PLC0415

    try:
        number = version("stickslip")
    except PackageNotFoundError:
        number = "unknown"
    words = COMMAND.get()
    command = "" if words is None else shown_name(shlex.join(["stickslip", *words]))
    files = [Input(shown_name(path.name), file_sha256(path)) for path in dict.fromkeys(inputs)]
    return Provenance(number, command, _now(), files)


def shown_name(text: str) -> str:
    """A name or a command with codes in place of control characters and bytes outside UTF-8, which SVG does not allow."""
    return plain(os.fsencode(text).decode(errors="backslashreplace"))


def _now() -> datetime:
    seconds = os.environ.get(_EPOCH, "")
    if re.fullmatch(r"[0-9]{1,11}", seconds):  # more digits are beyond the year 9999
        return datetime.fromtimestamp(int(seconds), UTC)
    return datetime.now(UTC).replace(microsecond=0)


def file_sha256(path: Path) -> str:
    """Hash of a file, in hexadecimal. Raises OSError."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
