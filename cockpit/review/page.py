"""A log, or two laid over each other, as one HTML file that loads nothing."""

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
SHARED_SCRIPTS = ("parts.js", "curves.js", "ribbon.js")  # of the page of a log and of that of a rig
_STYLES = ("vendor/uPlot.min.css", "page.css")
_SCRIPTS = (*SHARED_SCRIPTS, "page.js")
_UPLOT = ("vendor/LICENSE", "vendor/uPlot.iife.min.js")


def write_review(logs: Sequence[Path], out: Path) -> list[RunVerdict]:
    """Write the page of one log, or of two; what came of each.

    Raises Fault BAD_LOG, LOG_WRITE, and OSError where it cannot be written.
    """
    data, verdicts = review_data(logs, provenance(logs))
    names = " and ".join(shown_name(path.name) for path in logs)
    title = f"{names}: {headline(verdicts[0])}" if len(logs) == 1 else names
    parts = {
        "TITLE": html.escape(title),
        "STYLE": "\n".join(map(text_of, _STYLES)),
        # `</script>` in a text would end the element, and `<!--` change how it is read
        "DATA": json.dumps(strict_json(data), allow_nan=False, separators=(",", ":")).replace("<", "\\u003c"),
        "UPLOT": uplot(),
        "SCRIPT": "\n".join(map(text_of, _SCRIPTS)),
    }
    write_whole(out, filled(text_of("page.html"), parts))
    return verdicts


def text_of(name: str) -> str:
    """A file of this folder."""
    return (_FOLDER / name).read_text(encoding="utf-8")


def uplot() -> str:
    """The script that draws, below its licence."""
    licence, script = (text_of(name) for name in _UPLOT)
    return f"/*\n{licence}*/\n{script}"


def filled(template: str, parts: Mapping[str, str]) -> str:
    """A page whose places `@NAME@` are filled; there is no other `@` in the template."""
    pieces = template.split("@")  # text and names in turn
    return "".join(parts[one] if number % 2 else one for number, one in enumerate(pieces))
