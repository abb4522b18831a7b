"""The bench as one HTML page that needs nothing else: the table first, then each failure with its picture and its reason."""

from pathlib import Path
from typing import Any

from jinja2 import Environment, StrictUndefined

from bridge.files import write_whole
from bridge.provenance import provenance
from cockpit.bank.oracle import IN_PART, LIMIT, MISSED, TOO_LATE
from cockpit.bank.plots import picture
from cockpit.bank.record import CLAIMED, STUCK
from cockpit.bank.result import OWN, BankResult
from cockpit.bank.rules import NAMES, NONE
from cockpit.bank.run import Judged
from cockpit.bank.suite import Done


def write_page(result: BankResult, path: Path) -> None:
    """Write the page. Raises OSError where it cannot be."""
    about = {one.name: one.description for one in result.scenarios}
    failures = [_shown(one, about, one.figures.failures) for one in result.failed]
    explained = [
        _shown(one, about, [one.figures.oracle.in_words(one.figures.slips_from_enabling)])
        for one in result.explained
        if one.figures.oracle is not None
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
        explained=explained,
        verdicts={word: sum(one["oracle"] == word for one in failures) for word in (MISSED, TOO_LATE, IN_PART, LIMIT)},
        alone={one.figures.scenario: one.figures for one in result.done if one.figures.subject == NAMES[NONE]},
        runs=[one.figures for one in result.done if one.figures.subject == OWN],
        least=result.least,
        simulated_h=sum(one.figures.duration_s for one in result.done) / 3600.0,
    )
    write_whole(path, text)


def _shown(one: Done, about: dict[str, str], lines: list[str]) -> dict[str, Any]:
    """A run with its reasons and its picture."""
    return {
        "name": one.figures.scenario,
        "family": one.figures.family,
        "about": about[one.figures.scenario],
        "lines": lines,
        "figures": one.figures,
        "oracle": "" if one.figures.oracle is None else one.figures.oracle.verdict,
        "picture": "" if one.judged is None else picture(one.judged, *_first_wrong_s(one), one.oracle),
    }


def _first_wrong_s(one: Done) -> tuple[float, float]:
    """When the run first missed a bar that has a time, and for how long; else the middle of it."""
    judged: Judged | None = one.judged
    if judged is None:
        return 0.0, 0.0
    if one.first_s is not None:
        return one.first_s
    events = judged.events
    wrong = events[:, 0] == CLAIMED
    missed = (events[:, 0] == STUCK) & (events[:, 5] < 0.0) & (events[:, 6] == 0.0) & (events[:, 4] >= 0.0)
    for kind in (wrong, missed):
        if kind.any():
            first = events[kind][0]
            return float(first[1]), 0.0 if first[0] == CLAIMED else float(first[2] - first[1])
    return judged.sums["above_at_s"] or 0.5 * judged.duration_s, judged.sums["above_s"]
