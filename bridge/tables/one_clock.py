"""Channels that were sampled on separate clocks, resampled to one clock.

In a file of topics with different rates most cells are empty; LabVIEW and dSPACE give every channel a rate and a start. The
channel with most samples keeps its instants, within the time that all channels cover; the others are interpolated to them.
"""

from typing import NamedTuple

import numpy as np

from bridge.arrays import Floats, Indices
from bridge.log.finding import Finding
from bridge.units import counted

# Share of empty cells above which a channel counts as sampled separately. Smaller: a sensor that dropped out is interpolated.
_SEPARATE_ROWS = 0.1
_GAP_STEPS = 10.0  # longest gap that is interpolated, in median steps of the channel
_SAME_S = 1e-3  # largest difference of two equal instants, as a share of a step


class Sampled(NamedTuple):
    """A channel and its instants, [samples] each."""

    times_s: Floats
    values: Floats


def with_own_rows(t_s: Floats, columns: dict[str, Floats]) -> bool:
    """Whether a channel [rows] has separate rows: many empty cells, spread over the file."""
    return any(_has_own_rows(t_s, values) for values in columns.values())


def _has_own_rows(t_s: Floats, values: Floats) -> bool:
    empty = ~np.isfinite(values) & np.isfinite(t_s)
    rows = np.flatnonzero(~empty)
    # a column that begins later or ends sooner than the others is empty only at its ends
    if len(rows) < 2 or empty[rows[0] : rows[-1]].mean() <= _SEPARATE_ROWS:
        return False
    # a failed sensor leaves one long gap; separate rows are spread over the file
    return float(np.quantile(np.diff(rows), 0.9)) <= 20.0 * float(np.median(np.diff(rows))) and rows[-1] - rows[
        0
    ] > 0.5 * len(t_s)


def own_rows(t_s: Floats, columns: dict[str, Floats]) -> dict[str, Sampled]:
    """Each channel at the rows in which it has values; at all rows if it is not sampled separately."""
    channels: dict[str, Sampled] = {}
    for name, values in columns.items():
        filled = np.isfinite(values) & np.isfinite(t_s) if _has_own_rows(t_s, values) else np.ones(len(t_s), np.bool_)
        channels[name] = Sampled(t_s[filled], values[filled])
    return channels


def gaps_of(t_s: Floats) -> tuple[Indices, str]:
    """The rows before a gap, and a text that counts the gaps; `t_s` rises."""
    steps_s = np.diff(t_s)
    gaps = np.flatnonzero(steps_s > _GAP_STEPS * _step_s(t_s))
    if not len(gaps):
        return gaps, ""
    first = f"first at {t_s[gaps[0]]:.6g} s, the longest {steps_s.max():.3g} s"
    return gaps, f"{counted(len(gaps), 'gap')} in time, {first}"


def on_one_clock(channels: dict[str, Sampled], file: str) -> tuple[Floats, dict[str, Floats], list[Finding]]:
    """The instants [rows] and the channels at them, [rows] each; NaN in gaps. With a finding for each interpolated channel.

    Instants before the last channel starts, and after the first channel ends, are left out.
    """
    base = max(channels, key=lambda name: len(channels[name].times_s))
    times_s = channels[base].times_s
    if all(_same(channel.times_s, times_s) for channel in channels.values()):
        return times_s, {name: channel.values for name, channel in channels.items()}, []
    first_s = max(float(channel.times_s[0]) for channel in channels.values())
    last_s = min(float(channel.times_s[-1]) for channel in channels.values())
    step_s = _step_s(times_s)
    inside = (times_s >= first_s - _SAME_S * step_s) & (times_s <= last_s + _SAME_S * step_s)
    kept_s = times_s[inside]
    findings: list[Finding] = []
    columns: dict[str, Floats] = {}
    for name, channel in channels.items():
        if _same(channel.times_s, times_s):
            columns[name] = channel.values[inside]
            continue
        columns[name] = _interpolated(kept_s, channel)
        rate_Hz, late_s = 1.0 / _step_s(channel.times_s), float(channel.times_s[0] - times_s[0])
        late = (
            f" and begins {late_s:.6g} s {'later' if late_s > 0 else 'earlier'} ({base} at {times_s[0]:.6g} s)"
            if late_s
            else ""
        )
        text = (
            f"has its own clock of {rate_Hz:.6g} Hz{late}: interpolated to the clock of {base}, {1.0 / step_s:.6g} Hz"
        )
        findings.append(Finding("clock", f"{file}: {name}", text))
    if lost := int((~inside).sum()):
        text = f"{counted(lost, 'row')} left out, in which another channel has no data"
        findings.append(Finding("cut", f"{file}: {base}", text, lost))
    return kept_s, columns, findings


def _same(first_s: Floats, second_s: Floats) -> bool:
    return len(first_s) == len(second_s) and bool(
        np.allclose(first_s, second_s, rtol=0.0, atol=_SAME_S * _step_s(second_s))
    )


def _step_s(times_s: Floats) -> float:
    return float(np.median(np.diff(times_s))) if len(times_s) > 1 else 1.0


def _interpolated(at_s: Floats, channel: Sampled) -> Floats:
    """A channel at other instants [rows], linear between samples; NaN in its gaps."""
    order = np.argsort(channel.times_s, kind="stable")
    times_s, values = channel.times_s[order], channel.values[order]
    result = np.interp(at_s, times_s, values)
    before = np.clip(np.searchsorted(times_s, at_s, side="right") - 1, 0, len(times_s) - 2)
    wide = np.diff(times_s)[before] > _GAP_STEPS * _step_s(times_s)
    result[wide & ~np.isin(at_s, times_s)] = np.nan
    return result
