"""The verdict on a run, in the file NAME.verdict.json next to its log. It names the judged bytes by their SHA-256."""

import contextlib
import re
from pathlib import Path
from typing import Any

from bridge.faults import Fault
from bridge.files import read_json, refuse_to_replace_text
from bridge.results import write_json

VERDICT = "verdict"  # the metadata record with the verdict in logs of version 0.2
_DIGEST = "log_sha256"
_BEGINS = f'{{\n "{_DIGEST}": '  # first text of a verdict file


def verdict_path(log: Path) -> Path:
    """The verdict file of a log."""
    return log.with_suffix(".verdict.json")


def refuse_to_lose_other_file(log: Path) -> None:
    """Raise Fault CONFIG if the verdict file of a log would replace a file that holds no verdict."""
    refuse_to_replace_text(verdict_path(log), _BEGINS, str(log))


def remove_verdict(log: Path) -> None:
    """Remove the verdict file of a log that was replaced; another file of its name stays.

    A verdict file that cannot be removed is reported later: its digest differs.
    """
    with contextlib.suppress(OSError, Fault):
        refuse_to_lose_other_file(log)
        verdict_path(log).unlink()


def write_verdict(log: Path, sha256: str, fields: dict[str, Any]) -> None:
    """Write the verdict on a log with this digest, completely or not at all. Raises Fault CONFIG, LOG_WRITE."""
    refuse_to_lose_other_file(log)
    path = verdict_path(log)
    try:
        write_json(path, {_DIGEST: sha256} | fields)
    except OSError as error:
        line = f"{path}: the verdict cannot be written: {error.strerror}; the log is complete"
        remedy = f"free space or make the folder writable, then `stickslip log info {log}` judges the run again"
        raise Fault("LOG_WRITE", f"{line}: {remedy}") from None


def judged_sha256(log: Path) -> str | None:
    """The digest in the verdict file of a log; None without a file. Raises OSError, ValueError for a file without a verdict."""
    try:
        table = read_json(verdict_path(log))
    except FileNotFoundError:
        return None
    digest = table.get(_DIGEST) if isinstance(table, dict) else None
    if not isinstance(digest, str) or not re.fullmatch("[0-9a-f]{64}", digest):
        raise ValueError(f"holds no {_DIGEST}")
    return digest
