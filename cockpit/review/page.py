"""One log, or two overlaid, as one HTML file that loads nothing."""

import html
import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from bridge.files import strict_json, write_whole
from bridge.provenance import provenance, shown_name
from cockpit.judge.verdict import RunVerdict
from cockpit.judge.verdict_words import headline
from cockpit.review.data import review_data

_FOLDER = Path(__file__).parent
SHARED_SCRIPTS = ("parts.js", "curves.js", "ribbon.js")  # shared by the page of a log and the page of a running rig
_STYLES = ("vendor/uPlot.min.css", "page.css")
_SCRIPTS = (*SHARED_SCRIPTS, "page.js")
_UPLOT = ("vendor/LICENSE", "vendor/uPlot.iife.min.js")


def write_review(logs: Sequence[Path], out: Path) -> list[RunVerdict]:
    """Write the page of one log, or of two; returns the verdict of each.

    Raises Fault BAD_LOG, LOG_WRITE, and OSError if it cannot be written.
    """
    data, verdicts = review_data(logs, provenance(logs))
    names = " and ".join(shown_name(path.name) for path in logs)
    title = f"{names}: {headline(verdicts[0])}" if len(logs) == 1 else names
    parts = {
        "TITLE": html.escape(title),
        "STYLE": "\n".join(map(text_of, _STYLES)),
        # `</script>` in a text would end the element, and `<!--` would change the parsing
        "DATA": json.dumps(strict_json(data), allow_nan=False, separators=(",", ":")).replace("<", "\\u003c"),
        "UPLOT": uplot(),
        "SCRIPT": "\n".join(map(text_of, _SCRIPTS)),
    }
    write_whole(out, filled(text_of("page.html"), parts))
    return verdicts


def text_of(name: str) -> str:
    """Text of a file in this folder."""
    return (_FOLDER / name).read_text(encoding="utf-8")


def uplot() -> str:
    """The plotting script, below its licence."""
    licence, script = (text_of(name) for name in _UPLOT)
    return f"/*\n{licence}*/\n{script}"


def filled(template: str, parts: Mapping[str, str]) -> str:
    """Fill the places `@NAME@` of a template, which contains no other `@`."""
    pieces = template.split("@")  # text and names in turn
    return "".join(parts[piece] if number % 2 else piece for number, piece in enumerate(pieces))
