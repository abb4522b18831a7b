"""Pages: HTML files that load nothing, all with the style sheet page.css."""

import base64
import html
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

STYLE = Path(__file__).with_name("page.css")


def whole_page(title: str, body: str, *, head: str = "", style: str = "", scripts: Sequence[str] = ()) -> str:
    """A page around `body`, which is HTML and contains one h1 and one main element.

    Args:
        title: plain text.
        body: content of the body, HTML.
        head: more elements of the head.
        style: style sheet of a library, before page.css.
        scripts: scripts that run after the body.

    """
    ends = "".join(f"<script>\n{script}\n</script>\n" for script in scripts)
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n{head}<title>{html.escape(title)}</title>\n'
        f"<style>\n{style}{STYLE.read_text(encoding='utf-8')}</style>\n</head>\n<body>\n{body}\n{ends}</body>\n</html>\n"
    )


def filled_page(template: Path, title: str, footer: str = "", /, **values: Any) -> str:
    """A page whose main element is a Jinja template with `values`; `footer` is HTML."""
    from jinja2 import Environment, StrictUndefined  # noqa: PLC0415 - the pages of a log and of a running rig need no Jinja

    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    main = environment.from_string(template.read_text(encoding="utf-8")).render(values)
    return whole_page(title, f"<main>\n{main}\n</main>\n{footer}")


def png(figure: Any, dpi: float) -> str:
    """A figure of matplotlib as base64 of a PNG; transparent, so that the page's background shows, dark or light."""
    memory = io.BytesIO()
    figure.savefig(memory, format="png", dpi=dpi, transparent=True)
    return base64.b64encode(memory.getvalue()).decode()
