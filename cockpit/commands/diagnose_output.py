"""Output of `stickslip diagnose`: progress, the answer in words, one line per folder."""

from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import Literal, NamedTuple

from bridge import units
from bridge.plain import plain
from diagnosis.diagnose_many import FolderResult
from diagnosis.report import words
from diagnosis.report.words import number_lines, relation_lines
from diagnosis.result import Diagnosis

_SHOWN_CANDIDATES = 3


class Diagnoses(NamedTuple):
    """Results of many folders, in the order given."""

    results: list[FolderResult]
    format: Literal["diagnoses/2"] = "diagnoses/2"


def in_words(diagnosis: Diagnosis) -> list[str]:
    """Lines for the terminal: verdict, leading candidates, gap, next experiment, findings about the data."""
    gap, after = diagnosis.gap, diagnosis.next_experiment
    lines = [words.headline(diagnosis), *diagnosis.summary]
    for label, row in zip(("candidates", "", ""), diagnosis.candidates[:_SHOWN_CANDIDATES], strict=False):
        sizes = "; ".join(words.estimate_in_words(row.effect, *item) for item in row.parameters.items())
        lines.append(f"{label:<10} {row.effect:<28} {units.percent(row.probability):>8}   {sizes}".rstrip())
    if gap.files:
        numbers = [f"{units.times(gap.nominal)} as described", f"{units.times(gap.retuned)} baseline"]
        if diagnosis.effects:
            numbers.append(f"{units.times(gap.with_effect)} with {' and '.join(diagnosis.effects)}")
        shrinkage = "" if gap.shrinkage is None else f"; {words.closed_in_words(gap.shrinkage)} of the gap closed"
        lines.append(f"gap        {', '.join(numbers)}; perfect is {units.times(gap.floor)}{shrinkage}")
    for label, block in (("relations", relation_lines(diagnosis)), ("numbers", number_lines(diagnosis))):
        lines += [f"{'' if i else label:<10} {line}" for i, line in enumerate(block)]
    lines.append(f"next       {after.what} {after.why}")
    if diagnosis.cannot_show:
        lines.append(f"not shown  {', '.join(diagnosis.cannot_show)}: excluded by drive, runs or assumed numbers")
    files: dict[tuple[str, str], list[str]] = {}
    for finding in diagnosis.findings:
        file, _, column = finding.where.partition(": ")
        files.setdefault((column, finding.text), []).append(file)
    data = [f"{', '.join(where)}: {f'{column}: ' if column else ''}{text}" for (column, text), where in files.items()]
    return [*lines, *(f"{'' if i else 'data':<10} {line}" for i, line in enumerate(data))]


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
