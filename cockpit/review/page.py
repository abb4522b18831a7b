"""One log, or two overlaid, as one HTML file that works offline."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from bridge.files import write_whole
from bridge.pages import whole_page
from bridge.provenance import provenance, shown_name
from bridge.results import strict_json
from cockpit.judge.verdict import RunVerdict
from cockpit.judge.verdict_words import headline
from cockpit.review.data import review_data

_FOLDER = Path(__file__).parent
_SHARED = ("parts.js", "curves.js", "ribbon.js")  # shared by the page of a log and the page of a running rig
_UPLOT = ("vendor/LICENSE", "vendor/uPlot.iife.min.js")
_POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:"


class Reviewed(NamedTuple):
    """A page with its logs."""

    page: Path
    logs: list[RunVerdict]


def write_review(logs: Sequence[Path], out: Path) -> list[RunVerdict]:
    """Write the page of one log, or of two; returns the verdict of each.

    Raises Fault BAD_LOG, LOG_WRITE, and OSError if it cannot be written.
    """
    data, verdicts = review_data(logs, provenance(logs))
    names = " and ".join(shown_name(path.name) for path in logs)
    # `</script>` in a text would end the element, and `<!--` would change the parsing
    text = json.dumps(strict_json(data), allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    body = f'{text_of(_FOLDER / "page.html")}<script type="application/json" id="data">{text}</script>'
    title = f"{names}: {headline(verdicts[0])}" if len(logs) == 1 else names
    policy = f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">\n'
    write_whole(out, page_of_curves(title, body, policy, [_FOLDER / "page.js"]))
    return verdicts


def page_of_curves(title: str, body: str, head: str, scripts: Sequence[Path]) -> str:
    """A page with uPlot, the shared scripts, and its own scripts after them; `body` and `head` are HTML."""
    licence, uplot = (text_of(_FOLDER / name) for name in _UPLOT)
    script = "\n".join(map(text_of, [*(_FOLDER / name for name in _SHARED), *scripts]))
    style = text_of(_FOLDER / "vendor" / "uPlot.min.css")
    return whole_page(title, body, head=head, style=f"{style}\n", scripts=[f"/*\n{licence}*/\n{uplot}", script])


def text_of(path: Path) -> str:
    """Text of a file."""
    return path.read_text(encoding="utf-8")
