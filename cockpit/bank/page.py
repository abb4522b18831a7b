"""The bench as one HTML page that needs nothing else: the table first, then each failure with its picture and its reason."""

from pathlib import Path
from typing import Any

from jinja2 import Environment, StrictUndefined

from bridge.files import write_whole
from bridge.provenance import provenance
from cockpit.bank.figures import LIMIT
from cockpit.bank.plots import picture
from cockpit.bank.record import CLAIMED, STUCK
from cockpit.bank.result import OWN, BankResult
from cockpit.bank.run import Judged, wrong_from
from cockpit.bank.suite import Done


def write_page(result: BankResult, path: Path) -> None:
    """Write the page. Raises OSError where it cannot be."""
    about = {one.name: one.description for one in result.scenarios}
    failures: list[dict[str, Any]] = [
        {
            "name": one.figures.scenario,
            "family": one.figures.family,
            "about": about[one.figures.scenario],
            "lines": one.figures.failures,
            "limit": any(line.startswith(LIMIT) for line in one.figures.failures),
            "picture": "" if one.judged is None else picture(one.judged, _first_wrong_s(one)),
        }
        for one in result.failed
    ]
    template = Path(__file__).with_name("page.html.j2").read_text(encoding="utf-8")
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    subjects = list(dict.fromkeys(one.figures.subject for one in result.done))
    text = environment.from_string(template).render(
        result=result,
        footer=provenance().footer(),
        missed=sum(bar.holds is False for bar in result.bars),
        subjects=subjects,
        own=OWN,
        failures=failures,
        families=list(dict.fromkeys(one.family for one in result.scenarios)),
        runs=[one.figures for one in result.done if one.figures.subject == OWN],
        least=result.least,
        simulated_h=sum(one.figures.duration_s for one in result.done) / 3600.0,
    )
    write_whole(path, text)


def _first_wrong_s(one: Done) -> float:
    """When the run first missed a bar that has a time; else the middle of it."""
    judged: Judged | None = one.judged
    if judged is None:
        return 0.0
    events = judged.events
    wrong = wrong_from(events, one.figures.counted_from_s)
    wrong |= events[:, 0] == CLAIMED
    missed = (events[:, 0] == STUCK) & (events[:, 5] < 0.0) & (events[:, 6] == 0.0) & (events[:, 4] >= 0.0)
    for kind in (wrong, missed):
        if kind.any():
            return float(events[kind][0, 1])
    return judged.sums["above_at_s"] or 0.5 * judged.duration_s
