"""A log, or two laid over each other, as one HTML file that loads nothing."""

import html
import json
from collections.abc import Sequence
from pathlib import Path

from bridge.files import strict_json, write_whole
from bridge.provenance import provenance, shown_name
from cockpit.judge.verdict import RunVerdict
from cockpit.judge.verdict_words import headline
from cockpit.review.data import review_data

_FOLDER = Path(__file__).parent
_STYLES = ("vendor/uPlot.min.css", "page.css")
_SCRIPTS = ("curves.js", "ribbon.js", "page.js")
_UPLOT = ("vendor/LICENSE", "vendor/uPlot.iife.min.js")


def write_review(logs: Sequence[Path], out: Path) -> list[RunVerdict]:
    """Write the page of one log, or of two; what came of each.

    Raises Fault BAD_LOG, LOG_WRITE, and OSError where it cannot be written.
    """
    data, verdicts = review_data(logs, provenance(logs))
    names = " and ".join(shown_name(path.name) for path in logs)
    title = f"{names}: {headline(verdicts[0])}" if len(logs) == 1 else names
    licence, uplot = (_text(name) for name in _UPLOT)
    parts = {
        "TITLE": html.escape(title),
        "STYLE": "\n".join(map(_text, _STYLES)),
        # `</script>` in a text would end the element, and `<!--` change how it is read
        "DATA": json.dumps(strict_json(data), allow_nan=False, separators=(",", ":")).replace("<", "\\u003c"),
        "UPLOT": f"/*\n{licence}*/\n{uplot}",
        "SCRIPT": "\n".join(map(_text, _SCRIPTS)),
    }
    pieces = _text("page.html").split("@")  # text and names in turn
    write_whole(out, "".join(parts[one] if number % 2 else one for number, one in enumerate(pieces)))
    return verdicts


def _text(name: str) -> str:
    return (_FOLDER / name).read_text(encoding="utf-8")
