"""A picture of one test as SVG, 2 to 5 kB: a signal with the limit, window and instant of an expectation."""

import math
from collections.abc import Callable, Sequence
from html import escape

import numpy as np

from bridge.arrays import Floats
from cockpit.expect.judge import FAILED, UNTESTED, Expected
from cockpit.expect.record import Record
from cockpit.expect.tables import ExpectTable
from cockpit.figures.signals import SIGNALS

_WIDTH, _HEIGHT, _TOP = 640, 150, 20  # [px]; the text above the curve takes _TOP
Scale = Callable[[float], float]  # a time or value as a position [px]
_COLUMNS = 160  # of the envelope; 320: 6 kB a picture, 80: a slip of 10 ms in 16 s is still a peak


def picture(record: Record, expectations: Sequence[ExpectTable], results: Sequence[Expected]) -> str:
    """The expectation that decides, on its signal; the amplitude for events and states. Empty without a sample.

    Args:
        record: the log.
        expectations, results: of the log, in the same order.

    """
    order = {FAILED: 0, UNTESTED: 1}
    pairs = list(zip(expectations, results, strict=True))
    if not pairs:
        return ""
    table, result = min(pairs, key=lambda pair: (order.get(pair[1].result, 2), not pair[0].signal))
    name = table.signal or ("drive_force_N" if table.slips else "amplitude_m")
    samples = record.samples(name)
    if samples is None:
        return ""
    shown = samples.known & np.isfinite(samples.values)
    t_s, values = samples.t_s[shown], samples.values[shown] * SIGNALS[name].factor
    if not len(t_s):
        return ""
    limits = [limit * SIGNALS[name].factor for limit in table.limits if math.isfinite(limit)] if table.signal else []
    low, high = min([*limits, float(values.min())]), max([*limits, float(values.max())])
    high = high if high > low else low + 1.0
    end_s = max(float(t_s[-1]), record.end_s)
    from_s = record.begin_s + table.from_s
    to_s = record.end_s if table.end_s is None else record.begin_s + table.end_s

    def x(at_s: float) -> float:
        return round(_WIDTH * at_s / end_s, 1)

    def y(value: float) -> float:
        return round(_HEIGHT - 4 - (_HEIGHT - _TOP - 8) * (value - low) / (high - low), 1)

    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {_HEIGHT}" width="{_WIDTH}"',
        ' font-family="sans-serif" font-size="12">',
        f'<rect width="{_WIDTH}" height="{_HEIGHT}" fill="#fff"/>',
        f'<rect x="{x(from_s)}" y="{_TOP}" width="{x(to_s) - x(from_s):.1f}" height="{_HEIGHT - _TOP}" fill="#eaf2f8"/>',
        f'<path d="{_envelope(t_s, values, x, y)}" fill="none" stroke="#2a6fb5"/>',
    ]
    parts += [f'<path d="M0 {y(limit)}H{_WIDTH}" stroke="#b5402a" stroke-dasharray="6 3"/>' for limit in limits]
    if result.at_s is not None:
        parts.append(f'<path d="M{x(result.at_s)} {_TOP}V{_HEIGHT}" stroke="#b5402a"/>')
    unit = SIGNALS[name].unit
    words = f"{name}: {low:.4g} to {high:.4g} {unit}, 0 to {end_s:.4g} s; {result.name}: {result.result}"
    words += f" at {result.at_s:.4f} s" if result.at_s is not None else ""
    return "".join([*parts, f'<text x="4" y="14" fill="#1f2d3a">{escape(words)}</text></svg>'])


def _envelope(t_s: Floats, values: Floats, x: Scale, y: Scale) -> str:
    """A path that goes down and up in each column of the picture, from its least to its largest value."""
    column = np.minimum(_COLUMNS * t_s / max(float(t_s[-1]), 1e-9), _COLUMNS - 1).astype(np.int64)
    starts = np.flatnonzero(np.diff(column, prepend=-1))
    lows, highs = np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)
    points = [f"{x(at)} {y(low)}V{y(high)}" for at, low, high in zip(t_s[starts], lows, highs, strict=True)]
    return f"M{'L'.join(points)}"
