"""A look as one offline page."""

from pathlib import Path

from bridge.files import write_whole
from bridge.log.finding import Finding
from bridge.pages import filled_page
from bridge.provenance import provenance
from cockpit.look.plots import as_svg, pictures
from diagnosis.look.look import LookResult
from diagnosis.look.words import TITLES, headline, limits_of_look, with_interval


def write_page(seen: LookResult, source: Path, findings: list[Finding], out: Path) -> None:
    """Write the page. Raises OSError."""
    answer = headline(seen)
    text = filled_page(
        Path(__file__).with_name("page.html.j2"),
        f"{source.name}: {answer}",
        name=source.name,
        headline=answer,
        rows=[
            (symbol, with_interval(seen.numbers[name]), meaning)
            for name, (symbol, meaning) in TITLES.items()
            if name in seen.numbers
        ],
        open=limits_of_look(seen),
        figures=[(title, caption, as_svg(figure)) for title, caption, figure in pictures(seen)],
        findings=findings,
        provenance=provenance([source]).in_words(),
        seen=seen,
    )
    write_whole(out, text)
