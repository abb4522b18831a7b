"""Content of a page for one or two logs as one JSON object; curves are base64 of little-endian float32 on an even time grid."""

import base64
import contextlib
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bridge.log.logfile import RunData, block_period_ns, read_run
from bridge.log.storage.verdict_file import VERDICT
from bridge.log.watches.histogram import Histogram
from bridge.provenance import Provenance, shown_name
from bridge.wire.event_codes import SEVERITIES, event_code
from bridge.wire.words import word_of, words
from cockpit.figures.curves import Envelope, Grid, on_grid
from cockpit.figures.signals import BANDS, PANELS, Floats, Panel, PlottedSignal, holds, limits_of, samples_of
from cockpit.judge.judged import judge_tables
from cockpit.judge.verdict import RunVerdict
from cockpit.judge.verdict_words import headline, in_words
from diagnosis.slips import Cycles

FORMAT = "stickslip-review/1"
# Bins of all logs together; longer runs have wider bins. 11 signals of three values then take 3.5 MB, two runs of 20 s 4.5 MB.
_MOST_BINS = 20_000
_MOST_EVENTS = 2000  # events listed per log


def review_data(paths: Sequence[Path], made: Provenance) -> tuple[dict[str, Any], list[RunVerdict]]:
    """Data of the page, and the verdict of each log. Raises Fault BAD_LOG."""
    runs = [read_run(path) for path in paths]
    judged = [judge_tables(run) for run in runs]
    verdicts = [verdict for verdict, _ in judged]
    grid = _grid(runs, all(verdict.imported for verdict in verdicts))
    bands = [_bands(run, grid) for run in runs]
    data = {
        "format": FORMAT,
        "made": made.in_words(),
        "grid": grid._asdict(),
        "logs": [
            _log(run, *judgement, letter) | {"bands": of_log}
            for run, judgement, letter, of_log in zip(runs, judged, "AB", bands, strict=False)
        ],
        "figures": _figures(verdicts),
        "panels": [panel for panel in (_panel(panel, runs, grid) for panel in PANELS) if panel["curves"]],
        "words": _words([row for of_log in bands for row in of_log]),
        **parameters_of(runs),
    }
    return data, verdicts


def _grid(runs: Sequence[RunData], imported: bool) -> Grid:
    """One grid for all logs: a bin per block, or per sample of imported logs, whose blocks are long; wider bins for long runs."""
    t_s = [run.sensors["t_ns"] * 1e-9 for run in runs if len(run.sensors)]
    if not t_s:
        return Grid(0.0, 1e-3, 1)
    start_s, end_s = min(float(times.min()) for times in t_s), max(float(times.max()) for times in t_s)
    step_s = min(block_period_ns(run.sensors) for run in runs if len(run.sensors)) * 1e-9
    if imported:
        samples = max(run.sensors["drive_force_N"].shape[1] for run in runs if len(run.sensors))
        step_s /= samples
        start_s -= (samples - 1) * step_s  # a block is stamped at its last sample
    if (end_s - start_s) / step_s > _MOST_BINS:
        step_s = (end_s - start_s) / (_MOST_BINS // len(runs))
    return Grid(start_s, step_s, math.floor((end_s - start_s) / step_s + 0.5) + 1)


def _log(run: RunData, verdict: RunVerdict, cycles: Cycles | None, label: str) -> dict[str, Any]:
    return {
        "label": label,
        "name": shown_name(run.path.name),
        "answer": headline(verdict),
        "imported": verdict.imported,
        "good": None if verdict.imported and verdict.good else verdict.good,  # an import has no controller to judge
        "in_charge_from_s": verdict.enabled_from_s if verdict.enabled_from_s > 0 and not verdict.imported else None,
        "slips": []
        if cycles is None
        else np.round(np.column_stack([cycles.breakaway_t_s, cycles.breakaway_force_N]), 6).tolist(),
        "events": _events(run),
        "latency": _latency(run),
    }


def _figures(verdicts: Sequence[RunVerdict]) -> list[dict[str, Any]]:
    """Lines of the verdicts side by side: a row per title, with the text of each log."""
    tables: list[dict[str, list[str]]] = []
    for verdict in verdicts:
        lines: dict[str, list[str]] = {}
        for line in in_words(verdict, verbose=True)[1:]:
            title, _, words = line.partition(" ")
            lines.setdefault(title, []).append(words.strip())
        tables.append(lines)
    names = list(dict.fromkeys(name for lines in tables for name in lines if name != "log"))
    return [{"what": name, "logs": [lines.get(name, []) for lines in tables]} for name in names]


def _panel(panel: Panel, runs: Sequence[RunData], grid: Grid) -> dict[str, Any]:
    signals = panel.signals
    curves = [
        _curve(run, number, signal, grid)
        for signal in signals
        for number, run in enumerate(runs)
        if holds(run, signal.name)
    ]
    limits = [limits_of(run, signals[0].axis) for run in runs]
    named = [
        (words if len({*map(tuple, limits)}) == 1 else f"{words} ({chr(ord('A') + number)})", value)
        for number, of_log in enumerate(limits)
        for words, value in of_log
    ]
    return panel.heading() | {
        "empty": not any(curve["known"] for curve in curves),
        "slips": signals[0].name == "drive_force_N",
        "limits": [{"words": words, "value": value * signals[0].factor} for words, value in dict.fromkeys(named)],
        "curves": curves,
    }


def _curve(run: RunData, number: int, signal: PlottedSignal, grid: Grid) -> dict[str, Any]:
    t_s, values = samples_of(run, signal)
    made = on_grid(t_s, values * signal.factor, grid)
    if signal.topic != "sensors" and len(t_s) > 1:
        made = _held(made, math.ceil(float(np.median(np.diff(t_s))) / grid.step_s - 0.5))
    curve = signal.for_page() | {
        "log": number,
        "known": bool(np.isfinite(made.mean).any()),
        "mean": _packed(made.mean),
    }
    if not np.array_equal(made.least, made.most, equal_nan=True):
        curve |= {"least": _packed(made.least), "most": _packed(made.most)}
    return curve


def _held(made: Envelope, bins: int) -> Envelope:
    """Hold each value until the next, at most for `bins` bins, the interval of the values: so their curve has no holes."""
    if bins <= 1:
        return made
    known = np.flatnonzero(np.isfinite(made.mean))
    if not len(known):
        return made
    every = np.arange(len(made.mean))
    before = known[np.maximum(np.searchsorted(known, every, side="right") - 1, 0)]
    near = (every >= before) & (every - before < bins)
    return Envelope(*(np.where(near, values[before], np.nan) for values in made))


def _packed(values: Floats) -> str:
    return base64.b64encode(values.astype("<f4").tobytes()).decode("ascii")


def _events(run: RunData) -> list[dict[str, Any]]:
    # stalls of the computer may be many, so they are left out first
    first = sorted(run.events, key=lambda event: (event.code.endswith("PAUSE"), event.t_ns))[:_MOST_EVENTS]
    events = sorted(first, key=lambda event: event.t_ns)
    return [
        {
            "t_s": round(event.t_ns * 1e-9, 6),
            "source": event.source,
            "code": event.code,
            "text": event.text,
            "help": event_code(event.code).help.replace("`", ""),
            "weight": SEVERITIES[event_code(event.code).letter],
        }
        for event in events
    ]


def _latency(run: RunData) -> dict[str, Any] | None:
    """Histogram of the latency from a block to its command [us]; None in lockstep and without commands."""
    latency_us = Histogram()
    latency_us.add(run.applied["round_trip_ns"][run.applied["round_trip_ns"] > 0] * 1e-3)
    return latency_us.bars("us")


def parameters_of(runs: Sequence[RunData]) -> dict[str, Any]:
    """All settings of the processes of the first log, by keys such as `controller.limits.v_ratio`, and those that differ."""
    tables: list[dict[str, str]] = []
    for run in runs:
        table: dict[str, str] = {}
        for role in run.headers.keys() - {VERDICT}:  # a result, not a parameter
            for name, text in run.headers[role].items():
                value: Any = text
                with contextlib.suppress(ValueError):  # plain text, not JSON
                    value = json.loads(text)
                _flatten(f"{role}.{name}".replace(".configuration", ""), value, table)
        tables.append(table)
    rows = [
        (key, [table.get(key, "") for table in tables]) for key in sorted({key for table in tables for key in table})
    ]
    return {
        "parameters": [{"key": key, "value": value} for key, value in sorted(tables[0].items())],
        "differences": [{"key": key, "values": values} for key, values in rows if len({*values}) > 1],
    }


def _flatten(key: str, value: Any, into: dict[str, str]) -> None:
    if isinstance(value, dict):
        for name, inner in value.items():
            _flatten(f"{key}.{name}", inner, into)
        return
    into[key] = value if isinstance(value, str) else json.dumps(value)


def _bands(run: RunData, grid: Grid) -> list[dict[str, Any]]:
    """Modes and limits of the controller and the rig's guard, for the topics in a log: start, end [s] and word of intervals.

    An interval shorter than a grid step may be missing.
    """
    rows: list[dict[str, Any]] = []
    for band in BANDS:
        table = getattr(run, band.topic)
        numbers = table[band.field] if len(table) else np.zeros(0)
        if len(numbers) and (band.title in {"mode", "contact", "reason"} or numbers.any()):
            stretches = _stretches(table["t_ns"] * 1e-9, numbers, grid, band.column)
            rows.append({"title": band.title, "stretches": stretches})
    return rows


def _words(bands: Sequence[dict[str, Any]]) -> list[dict[str, str]]:
    """Each word of a row of bands once, with its meaning, in the order of the rows."""
    used = {(row["title"], word) for row in bands for _, _, word in row["stretches"]}
    return [
        {"row": band.title, "word": _lower(word.word), "help": word.help.replace("`", "")}
        for band in BANDS
        for word in words()
        if word.column == band.column and (band.title, _lower(word.word)) in used
    ]


def _lower(word: str) -> str:
    return word.lower().replace("_", " ")


def _stretches(t_s: Any, numbers: Any, grid: Grid, column: str) -> list[tuple[float, float, str]]:
    """Intervals of a constant number. Each starts one step early: numbers are reported at the end of a block."""
    at = np.rint((t_s - grid.start_s) / grid.step_s)
    last_of_bin = np.flatnonzero(np.diff(at, append=np.inf) != 0)
    at, numbers = at[last_of_bin], numbers[last_of_bin]
    starts = np.flatnonzero(np.diff(numbers.astype(np.int64), prepend=-1))
    ends = np.append(starts[1:] - 1, len(numbers) - 1)
    return [
        (
            round(grid.start_s + (float(at[start]) - 1.0) * grid.step_s, 6),
            round(grid.start_s + float(at[end]) * grid.step_s, 6),
            _lower(word_of(column, int(numbers[start]))),
        )
        for start, end in zip(starts, ends, strict=True)
    ]
