"""Index of a fleet: one offline HTML page that links to the reports of its rigs."""

from pathlib import Path
from urllib.parse import quote

from jinja2 import Environment, StrictUndefined

from bridge.files import write_whole
from bridge.provenance import provenance
from bridge.units import counted, interval, percent
from cockpit.fleet.groups import Fleet, RigGroup


def write_page(fleet: Fleet, path: Path) -> None:
    """Write the page. Raises Fault LOG_WRITE, OSError."""
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    template = Path(__file__).with_name("page.html.j2").read_text(encoding="utf-8")
    shared = [group for group in fleet.groups if group.kind != "no-gap"]
    text = environment.from_string(template).render(
        fleet=fleet,
        shared=shared,
        without=[rig for group in fleet.groups if group.kind == "no-gap" for rig in group.rigs],
        rigs=sum(len(group.rigs) for group in shared),
        title=_title,
        percent=percent,
        between=interval,
        counted=counted,
        link=quote,
        most=max((group.helps for group in shared), default=0.0),
        footer=provenance().footer(),
    )
    write_whole(path, text)


def _title(group: RigGroup) -> str:
    """Title of a group: the shared cause."""
    if group.kind == "named":
        return group.what
    return f"unexplained: {group.what}" if group.what else "unexplained, without a known common cause"
