"""Index of a fleet: one offline HTML page that links to the reports of its rigs."""

from pathlib import Path
from urllib.parse import quote

from bridge.files import write_whole
from bridge.pages import filled_page
from bridge.provenance import provenance
from bridge.units import counted, interval, percent
from cockpit.fleet.groups import Fleet, RigGroup


def write_page(fleet: Fleet, path: Path) -> None:
    """Write the page. Raises Fault LOG_WRITE, OSError."""
    shared = [group for group in fleet.groups if group.kind != "no-gap"]
    text = filled_page(
        Path(__file__).with_name("page.html.j2"),
        f"Fleet of {counted(fleet.folders, 'rig')}",
        provenance().footer(),
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
    )
    write_whole(path, text)


def _title(group: RigGroup) -> str:
    """Title of a group: the shared cause."""
    if group.kind == "named":
        return group.what
    return f"unexplained: {group.what}" if group.what else "unexplained, without a known common cause"
