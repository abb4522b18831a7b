"""A look as one offline page."""

from pathlib import Path

from jinja2 import Environment, StrictUndefined

from bridge.files import write_whole
from bridge.log.finding import Finding
from bridge.provenance import provenance
from cockpit.look.plots import as_svg, pictures
from diagnosis.look.look import LookResult
from diagnosis.look.words import TITLES, cannot_tell, headline, with_interval


def write_page(seen: LookResult, source: Path, findings: list[Finding], out: Path) -> None:
    """Write the page. Raises OSError."""
    template = Path(__file__).with_name("page.html.j2").read_text(encoding="utf-8")
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    text = environment.from_string(template).render(
        name=source.name,
        headline=headline(seen),
        rows=[
            (symbol, with_interval(seen.numbers[name]), meaning)
            for name, (symbol, meaning) in TITLES.items()
            if name in seen.numbers
        ],
        open=cannot_tell(seen),
        figures=[(title, caption, as_svg(figure)) for title, caption, figure in pictures(seen)],
        findings=findings,
        provenance=provenance([source]).in_words(),
        seen=seen,
    )
    write_whole(out, text)
