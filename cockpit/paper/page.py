"""`stickslip reproduce`: redo the paper's calculation and report line by line whether it holds."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import jinja2  # noqa: F401  # pyright: ignore[reportUnusedImport] - a missing package fails before minutes of simulation

from bridge.files import write_whole
from bridge.pages import filled_page
from bridge.provenance import provenance
from bridge.results import in_json
from cockpit.paper.claims import PAPER_CLAIMS, PaperRow, paper_claims, parameter_rows, reference_rows, slip_rows
from cockpit.paper.plots import figures
from cockpit.paper.runs import (
    CYCLES_FROM_S,
    PTFE_PAIRS,
    STEEL_PAIRS,
    Key,
    PairRun,
    one_slip,
    paper_rig,
    plan,
    run,
    starts_s,
)


class ReproduceResult(NamedTuple):
    """All checks of the report in order, and the total time."""

    rows: list[PaperRow]
    elapsed_s: float

    @in_json
    def passed(self) -> bool:
        """True if every check holds."""
        return all(row.passed for row in self.rows)

    @in_json
    def verdict(self) -> str:
        """How many claims and checks hold, in one line."""
        held = sum(row.passed for row in self.rows)
        claims = [row for row in self.rows if row.group == PAPER_CLAIMS]
        claims_held = sum(row.passed for row in claims)
        of_the_paper = f"{claims_held} of {len(claims)} claims of the paper hold"
        return f"{of_the_paper}; {held} of {len(self.rows)} checks in all"


def reproduce(out: Path, progress: Callable[[float], None] = lambda _share: None) -> ReproduceResult:
    """Redo the paper and write the report to `out`, one self-contained HTML file.

    The file is written at once, after all computations; `progress` is called with the share done.

    Raises OSError when `out` cannot be written.
    """
    started_s = time.perf_counter()
    runs: dict[Key, PairRun] = {}
    for done, key in enumerate(keys := plan()):
        progress(done / len(keys))
        runs[key] = run(*key)
    slip = one_slip("C45-C45 @ 0.063")
    rows = paper_claims(runs) + reference_rows(runs) + slip_rows(slip) + parameter_rows()
    result = ReproduceResult(rows, time.perf_counter() - started_s)
    write_whole(out, _page(result, runs))
    return result._replace(elapsed_s=time.perf_counter() - started_s)


def _page(result: ReproduceResult, runs: dict[Key, PairRun]) -> str:
    groups: dict[str, list[PaperRow]] = {}
    for row in result.rows:
        groups.setdefault(row.group, []).append(row)
    one_kHz = runs["C45-C45 @ 0.063", 1000]
    drifting = runs["C45-C45 @ 0.063", 5000].course
    return filled_page(
        Path(__file__).with_name("page.html.j2"),
        f"Stick-slip paper, reproduced: {result.verdict}",
        provenance().footer(),
        result=result,
        groups=groups,
        rigs={pair: paper_rig(pair) for pair in (*STEEL_PAIRS, *PTFE_PAIRS)},
        figures=figures(runs),
        starts_s=starts_s(1000),
        scatter_percent=100.0 * one_kHz.scatter.period_s / one_kHz.mean.period_s,
        drifting_N=drifting.drive_force_N[drifting.t_s > CYCLES_FROM_S].mean(),
    )
