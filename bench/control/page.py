"""The bench as one HTML page without other files: the table first, then each failure with its picture and its reason."""

from pathlib import Path
from typing import Any

from bench.control.oracle import IN_PART, LIMIT, MISSED, TOO_LATE
from bench.control.plots import picture
from bench.control.record import CLAIMED, STUCK
from bench.control.result import OWN, BankResult
from bench.control.rules import NAMES, NONE
from bench.control.run import Judged
from bench.control.suite import Done
from bridge.files import write_whole
from bridge.pages import filled_page
from bridge.provenance import provenance


def write_page(result: BankResult, path: Path) -> None:
    """Write the page. Raises OSError where it cannot be written."""
    about = {scenario.name: scenario.description for scenario in result.scenarios}
    failures = [_shown(run, about, run.figures.failures) for run in result.failed]
    explained = [
        _shown(run, about, [run.figures.oracle.in_words(run.figures.slips_from_enabling)])
        for run in result.explained
        if run.figures.oracle is not None
    ]
    subjects = list(dict.fromkeys(run.figures.subject for run in result.done))
    text = filled_page(
        Path(__file__).with_name("page.html.j2"),
        f"The controller on {len(result.scenarios)} simulated scenarios",
        provenance().footer(),
        result=result,
        missed=sum(bar.holds is False for bar in result.bars),
        subjects=subjects,
        own=OWN,
        failures=failures,
        explained=explained,
        verdicts={word: sum(row["oracle"] == word for row in failures) for word in (MISSED, TOO_LATE, IN_PART, LIMIT)},
        alone={run.figures.scenario: run.figures for run in result.done if run.figures.subject == NAMES[NONE]},
        runs=[run.figures for run in result.done if run.figures.subject == OWN],
        least=result.least,
        simulated_h=sum(run.figures.duration_s for run in result.done) / 3600.0,
    )
    write_whole(path, text)


def _shown(run: Done, about: dict[str, str], lines: list[str]) -> dict[str, Any]:
    """A run with its lines of text and its picture, for the template."""
    return {
        "name": run.figures.scenario,
        "family": run.figures.family,
        "about": about[run.figures.scenario],
        "lines": lines,
        "figures": run.figures,
        "oracle": "" if run.figures.oracle is None else run.figures.oracle.verdict,
        "picture": "" if run.judged is None else picture(run.judged, *_first_wrong_s(run), run.oracle),
    }


def _first_wrong_s(run: Done) -> tuple[float, float]:
    """Begin and duration of the run's first failure that has a time [s]; without one, the middle of the run."""
    judged: Judged | None = run.judged
    if judged is None:
        return 0.0, 0.0
    if run.first_s is not None:
        return run.first_s
    events = judged.events
    wrong = events[:, 0] == CLAIMED
    missed = (events[:, 0] == STUCK) & (events[:, 5] < 0.0) & (events[:, 6] == 0.0) & (events[:, 4] >= 0.0)
    for kind in (wrong, missed):
        if kind.any():
            first = events[kind][0]
            return float(first[1]), 0.0 if first[0] == CLAIMED else float(first[2] - first[1])
    return judged.sums["above_at_s"] or 0.5 * judged.duration_s, judged.sums["above_s"]
