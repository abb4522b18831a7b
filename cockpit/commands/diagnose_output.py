"""Output of `stickslip diagnose`: progress, the answer in words, one line per folder."""

import math
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import Literal, NamedTuple

from bridge import units
from bridge.plain import plain
from diagnosis.diagnose_many import FolderResult
from diagnosis.report import words
from diagnosis.report.summary import line
from diagnosis.result import Diagnosis


class Diagnoses(NamedTuple):
    """Results of many folders, in the order given."""

    results: list[FolderResult]
    format: Literal["diagnoses/3"] = "diagnoses/3"


def details(diagnosis: Diagnosis) -> list[str]:
    """Lines below the answer: candidates, gap, relations, numbers, reason of the next experiment, findings about the data."""
    gap = diagnosis.gap
    candidates: list[str] = []
    for row in diagnosis.candidates:
        if row.effect not in diagnosis.effects and not math.isfinite(row.probability):
            continue
        sizes = "; ".join(words.estimate_in_words(row.effect, *item) for item in row.parameters.items())
        candidates.append(f"{row.effect:<28} {units.percent(row.probability):>8}   {sizes}".rstrip())
    compared = [
        f"{units.times(row.gap)} with {words.who_in_words(row.who)}"
        + ("" if row.shrinkage is None else f", {words.closed_in_words(row.shrinkage)} closed")
        for row in gap.compared
    ]
    files: dict[tuple[str, str], list[str]] = {}
    for finding in diagnosis.findings:
        file, _, column = finding.where.partition(": ")
        files.setdefault((column, finding.text), []).append(file)
    blocks = {
        "candidates": candidates,
        "gap": [f"{units.times(gap.nominal)} as described", *compared] if gap.files else [],
        "relations": words.relation_lines(diagnosis),
        "numbers": words.number_lines(diagnosis),
        "next": [diagnosis.next_experiment.why],
        "not shown": [f"{', '.join(diagnosis.cannot_show)}: excluded by drive, runs or assumed numbers"]
        if diagnosis.cannot_show
        else [],
        "data": [
            f"{', '.join(where)}: {f'{column}: ' if column else ''}{text}" for (column, text), where in files.items()
        ],
    }
    return [line("" if number else label, text) for label, block in blocks.items() for number, text in enumerate(block)]


def in_a_line(outcome: FolderResult) -> str:
    """Result of one folder among many, in one line."""
    if outcome.diagnosis is not None:
        # "holdout" reports a run held out by default, which is not a defect of the data
        doubts = sum(finding.kind != "holdout" for finding in outcome.diagnosis.findings)
        data = f"; {units.counted(doubts, 'finding')} about its data, see --json" if doubts else ""
        return f"{outcome.source.name}: {words.headline(outcome.diagnosis)}{data}"
    code, line = outcome.fault or ("", "")
    return f"{outcome.source.name}: {code}: {line}"


@contextmanager
def watched() -> Generator[Callable[[str, float], None]]:
    """Intermediate results line by line on stderr, with a progress bar below on a terminal."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TimeElapsedColumn, TimeRemainingColumn

    columns, last = (BarColumn(), TaskProgressColumn(), TimeElapsedColumn(), TimeRemainingColumn()), ""
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("", total=1.0)

        def show(text: str, share: float) -> None:
            nonlocal last
            if text != last:
                console.print(plain(text), markup=False, highlight=False, emoji=False, soft_wrap=True)
            last = text
            bar.update(task, completed=share)

        yield show
