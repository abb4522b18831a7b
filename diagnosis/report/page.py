"""The report of a diagnosis: a single HTML file that needs no other file, with the answer first."""

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final, NamedTuple

from bridge import units
from bridge.files import write_whole
from bridge.pages import filled_page
from bridge.provenance import provenance
from diagnosis.judge.outcome import BEYOND
from diagnosis.report import words
from diagnosis.report.page_plots import draw
from diagnosis.result import Cell, Diagnosis, Gap, RigNumber

_REGIMES = ("stick", "breakaway", "slip", "restick", "steady")
# Share of the gap below which a row of the map is left out and only counted. Smaller: a long map. Larger: rows are missed.
_SMALL = 0.005
# Probability below which an effect is listed by name alone. Smaller: a long table. Larger: candidates are missed.
_SMALL_PROBABILITY = 0.015
_BANNERS: Final = {
    "effect": "An effect was found",
    "partly": "A part is explained",
    "described": "A described number was wrong",
    "no-gap": "No gap",
    "unexplained": "Unexplained gap",
    "not-finished": "Not finished",
}


class GapBar(NamedTuple):
    """One bar of the gap chart; `value` in noise floors, `width` in percent of the widest bar."""

    label: str
    value: float
    width: float
    style: str  # a style of `diagnosis.report.page_plots`


class MapRow(NamedTuple):
    """A row of the map: signal, regime and band, and their share of the gap in every run (None: the run has no such cell)."""

    signal: str
    regime: str
    band: str
    shares: list[float | None]


class RigRow(NamedTuple):
    """A number of the rig, as text.

    `shift_sd` is the refitted less the described number, in tolerances; None for a number that is known exactly or not finite.
    """

    name: str
    described: str
    retuned: str
    tolerance: str
    shift_sd: float | None


def write_report(diagnosis: Diagnosis, evidence_name: str, path: Path, files: Iterable[Path] = ()) -> None:
    """Write the report to `path`, completely or not at all; its footer has the hashes of `files`, the evidence's files.

    Raises OSError when it cannot be written, or a file cannot be read.
    """
    write_whole(path, report_page(diagnosis, evidence_name, provenance(files).footer()))


def report_page(diagnosis: Diagnosis, evidence_name: str, footer: str = "") -> str:
    """The report as the text of an HTML file; `footer` is HTML."""
    answer = words.answer(diagnosis)
    shown = [
        row for row in diagnosis.candidates if row.effect in diagnosis.effects or row.probability >= _SMALL_PROBABILITY
    ]
    runs, rows, left_out = where_map(diagnosis.where)
    return filled_page(
        Path(__file__).with_name("page.html.j2"),
        f"{evidence_name}: {diagnosis.verdict}, {answer}",
        footer,
        diagnosis=diagnosis,
        evidence_name=evidence_name,
        banner=_BANNERS[diagnosis.verdict],
        answer=answer,
        shown=shown,
        hidden=[row.effect for row in diagnosis.candidates if row.probability < _SMALL_PROBABILITY],
        estimate=words.estimate_in_words,
        meanings=words.EFFECT_WORDS,
        gap_bars=gap_bars(diagnosis.gap, bool(diagnosis.effects)),
        floor_at=_width(diagnosis.gap.floor / _widest(diagnosis.gap)),
        runs=runs,
        rows=rows,
        left_out=left_out,
        strongest=max((share for row in rows for share in row.shares if share is not None), default=0.0),
        largest=_cell_in_words(diagnosis.where[0]) if diagnosis.where else "",
        drawn=draw(diagnosis.pictures),
        rig=[rig_row(parameter) for parameter in diagnosis.rig],
        percent=units.percent,
        width=_width,
        times=units.times,
        who=words.who_in_words,
        closed=words.closed_in_words,
        closed_between=words.closed_between,
        sizes=words.sizes_in_words,
        remainder=words.remainder_in_words,
        between=units.interval,
        beyond=BEYOND,
    )


def gap_bars(gap: Gap, named: bool) -> list[GapBar]:
    """Bars for the rig as described, the baseline, and the named effect if there is one; the width of NaN is 0."""
    bars = [("the rig as described", gap.nominal, "nominal"), ("baseline", gap.retuned, "retuned")]
    if named:
        bars.append(("with the best explanation", gap.with_effect, "effect"))
    widest = _widest(gap)
    return [GapBar(label, value, _width(value / widest), style) for label, value, style in bars]


def _width(share: float) -> float:
    """Width of the bar of a share in percent; 0 for NaN."""
    return min(max(100.0 * share, 0.0), 100.0) if math.isfinite(share) else 0.0


def _widest(gap: Gap) -> float:
    sizes = [gap.nominal, gap.retuned, gap.with_effect, gap.floor]
    return max((size for size in sizes if math.isfinite(size) and size > 0.0), default=1.0)


def where_map(cells: tuple[Cell, ...]) -> tuple[list[str], list[MapRow], float]:
    """The runs, the rows above `_SMALL`, and the total share of the rows that are left out."""
    runs = sorted({cell.file for cell in cells})
    table: dict[tuple[str, str, tuple[float, float]], dict[str, float]] = {}
    for cell in cells:
        shares = table.setdefault((cell.signal, cell.regime, cell.band_Hz), {})
        shares[cell.file] = shares.get(cell.file, 0.0) + cell.share
    rows: list[MapRow] = []
    left_out = 0.0
    order = {regime: number for number, regime in enumerate(_REGIMES)}
    for key in sorted(table, key=lambda key: (key[0], order.get(key[1], len(order)), key[1], key[2])):
        shares = table[key]
        if not max(shares.values()) >= _SMALL:  # written so that NaN is left out too
            left_out += sum(share for share in shares.values() if math.isfinite(share))
        else:
            rows.append(
                MapRow(units.signal_name(key[0]), key[1], units.band(key[2]), [shares.get(run) for run in runs])
            )
    return runs, rows, left_out


def _cell_in_words(cell: Cell) -> str:
    place = f"{units.signal_name(cell.signal)}, {cell.regime}, {units.band(cell.band_Hz)}, {cell.file}"
    return f"{units.percent(cell.share)} in {place}"


def rig_row(parameter: RigNumber) -> RigRow:
    """A number of the rig as a row of the table."""
    name, unit = units.name_and_unit(parameter.name)
    scale = (parameter.described or 1.0) * parameter.tolerance
    shift: Any = (parameter.retuned - parameter.described) / scale if scale else None
    return RigRow(
        name,
        units.quantity(parameter.described, unit),
        units.quantity(parameter.retuned, unit),
        _tolerance(parameter),
        shift if shift is not None and math.isfinite(shift) else None,
    )


def _tolerance(parameter: RigNumber) -> str:
    if not parameter.tolerance:
        return "known exactly"
    return f"± {100.0 * parameter.tolerance:g} %" if parameter.described else f"± {parameter.tolerance:g}"
