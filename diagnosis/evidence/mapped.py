"""The standard columns of a table, in SI units, on one clock, without values that a program writes for a missing measurement."""

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.arrays import Bools, Floats
from bridge.faults import Fault
from bridge.log.finding import Finding
from bridge.tables.one_clock import Sampled, on_one_clock, own_rows, with_own_rows
from bridge.tables.pieces import in_pieces
from bridge.tables.table import Table
from bridge.tables.unit_words import known_unit, si_unit, weight_unit
from bridge.units import counted
from diagnosis.evidence.manifest_keys import STANDARD, ChannelMap, Columns

# Values from which a column of times without a unit counts calendar time, not time of the run, with its unit [s]
_SINCE_1970 = ((1e17, 1e-9), (1e14, 1e-6), (1e11, 1e-3), (1e8, 1.0))
# Days from 2000 to 2100 as spreadsheets and MATLAB's datenum count them. Their steps distinguish them from seconds: a step of
# less than 2e-5 is a rate above 50 kHz in seconds, and above 0.6 rows a second in days.
_DAYS = ((36526.0, 73051.0), (730486.0, 767011.0))
_DAY_S, _LONGEST_STEP = 86400.0, 2e-5
# Distance from the median, in spreads (5th to 95th percentile), from which a value is a sentinel: any value; a number of nines
# such as -9999, or a repeated value such as full scale. A slip moves a force or a position by a few spreads.
_FAR_AWAY, _FAR_ALIKE = 1000.0, 20.0
_NO_VALUE = 1e20  # 1e30 and the largest float32 mean "no value"
_NINES = re.compile(r"0*9{3,}0*")


class Mapped(NamedTuple):
    """The standard columns of a table, [rows] each, in SI units, and the findings."""

    columns: Columns
    findings: list[Finding]
    starts_s: tuple[float, ...] = ()  # start of each piece, where the time begins again; empty for a single piece


def mapped(
    table: Table, channels: dict[str, ChannelMap], sample_rate_Hz: float | None = None, rotary: bool | None = None
) -> Mapped:
    """The standard columns that `channels` names.

    The time is taken from `sample_rate_Hz`, else from its column, else from the clock in the file. `rotary`: a rotary rig; None:
    unknown, so both N and N m are accepted.

    Raises Fault BAD_TABLE for a column that is missing, is of another length or of another quantity; CONFIG without a time.
    """
    findings: list[Finding] = []
    values = {
        name: _in_si(table, name, channels[name], findings, rotary)
        for name in STANDARD
        if name in channels and name != "t_s"
    }
    file = table.path.name
    if "t_s" in channels and sample_rate_Hz is not None:
        text = (
            f"column {channels['t_s'].column} is not used as the time: the rate of {sample_rate_Hz:.9g} Hz replaces it"
        )
        findings.append(Finding("time", f"{file}: t_s", text))
    elif "t_s" in channels:
        t_s, starts_s, of_pieces = in_pieces(_time(table, channels["t_s"], findings), table.segments, f"{file}: t_s")
        findings += of_pieces
        _same_length(table, channels, values, len(t_s), "the time")
        if with_own_rows(t_s, values):
            t_s, values, moved = on_one_clock(own_rows(t_s, values), file)
            findings += moved
        return Mapped({"t_s": t_s} | values, table.findings + findings, starts_s)
    clocks = {name: table.clocks.get(table.find(channels[name].column)) for name in values}
    if sample_rate_Hz is None and values and all(clock is not None for clock in clocks.values()):
        sampled = {
            name: _sampled(clock.times(len(values[name])), values[name])
            for name, clock in clocks.items()
            if clock is not None
        }
        t_s, values, moved = on_one_clock(sampled, file)
        return Mapped({"t_s": t_s} | values, table.findings + findings + moved)
    rate_Hz = sample_rate_Hz or table.sample_rate_Hz
    if rate_Hz is None:
        line = f'{file}: no time: name its column, channels.t_s = "NAME", or add under [source] sample_rate_Hz = 1000.0'
        raise Fault("CONFIG", f"{line} (columns here: {', '.join(table.columns)})")
    if sample_rate_Hz is None:
        findings.append(Finding("assumed", file, f"sample_rate_Hz = {rate_Hz:.9g}, as the file states"))
    rows = len(next(iter(values.values())))
    _same_length(table, channels, values, rows, "the first channel")
    begins = [segment.row for segment in table.segments] or [0]
    t_s = (np.arange(rows) - np.repeat(begins, np.diff([*begins, rows]))) / rate_Hz
    t_s, starts_s, of_pieces = in_pieces(t_s, table.segments, file)
    return Mapped({"t_s": t_s} | values, table.findings + findings + of_pieces, starts_s)


def piece_of(t_s: Floats, starts_s: Sequence[float], piece: int, file: str, place: str = "--piece") -> Bools:
    """The rows of a piece, from 1, [rows]. Raises Fault CONFIG, which names the `place`, for a number without a piece."""
    starts_s = (-np.inf, *starts_s[1:], np.inf)
    if not 1 <= piece < len(starts_s):
        raise Fault("CONFIG", f"{place} {piece}: must be from 1 to {len(starts_s) - 1}, the pieces of {file}")
    return (t_s >= starts_s[piece - 1]) & (t_s < starts_s[piece])


def _sampled(times_s: Floats, values: Floats) -> Sampled:
    """A channel without the rows behind its last time, where another channel of the file is longer."""
    finite = np.isfinite(times_s)
    return Sampled(times_s[finite], values[finite])


def has_time(table: Table, channels: dict[str, ChannelMap]) -> bool:
    """Whether a column, the file, or the clocks of all channels give the time."""
    with_clock = [table.clocks.get(table.find(channel.column)) is not None for channel in channels.values()]
    return "t_s" in channels or table.sample_rate_Hz is not None or (bool(with_clock) and all(with_clock))


def _same_length(table: Table, channels: dict[str, ChannelMap], values: Columns, rows: int, reference: str) -> None:
    for name, column in values.items():
        if len(column) != rows:
            line = (
                f"{table.path.name}: column {channels[name].column}: {counted(len(column), 'row')}: must have {rows}, as "
                f"{reference}; every channel needs one value a sample"
            )
            raise Fault("BAD_TABLE", line)


def _in_si(table: Table, name: str, channel: ChannelMap, findings: list[Finding], rotary: bool | None) -> Floats:
    """A channel in its SI unit: by its scale, by the unit of the map, or by the unit of the file."""
    values, outliers = without_sentinels(
        table.column(channel.column), f"{table.path.name}: column {channel.column}", not STANDARD[name].has_spikes
    )
    findings += outliers
    return values * _factor(table, name, channel, findings, rotary) + channel.offset


def _factor(table: Table, name: str, channel: ChannelMap, findings: list[Finding], rotary: bool | None) -> float:
    if channel.scale is not None:
        return channel.scale
    unit = channel.unit or table.unit(channel.column)
    known = None if not unit else weight_unit(unit) if STANDARD[name].quantity == "force" else known_unit(unit)
    if known is None:
        column = table.find(channel.column)
        stated = table.stated_unit(column)
        if stated and not unit:  # an unknown unit in a line of units is reported where that line is read
            text = f"column {column}: {stated!r} is not a known unit: the values are used unscaled; a map may give scale = ..."
            findings.append(Finding("units", f"{table.path.name}: {name}", text))
        return 1.0
    quantity, factor = known
    if rotary is False and quantity == STANDARD[name].turning != STANDARD[name].quantity:
        line = f"{table.path.name}: column {channel.column}: is in {unit}, a {quantity}, and the rig slides"
        raise Fault("BAD_TABLE", f'{line}; a rotary rig has drive = "torsion" under [rig]')
    if quantity not in (STANDARD[name].quantity, STANDARD[name].turning):
        line = f"{table.path.name}: column {channel.column}: is in {unit}, a {quantity}"
        line += f": must be a {STANDARD[name].quantity}, as {name}"
        raise Fault("BAD_TABLE", f"{line}; name another column, or give channels.{name}.scale")
    if factor != 1.0 and not channel.unit:
        text = f"column {channel.column} is in {unit}: times {factor:g} to be in {si_unit(quantity)}"
        findings.append(Finding("units", f"{table.path.name}: {name}", text))
    return factor


def _time(table: Table, channel: ChannelMap, findings: list[Finding]) -> Floats:
    """The time in s, [rows]; a calendar time is counted from the first row."""
    times_s, is_clock = table.seconds(channel.column)
    where = f"{table.path.name}: t_s"
    if is_clock:
        if channel.scale not in (None, 1.0):
            raise Fault(
                "CONFIG", f"{where}: column {channel.column} holds times: scale must be left out; they count in s"
            )
        return times_s + channel.offset
    if channel.scale is not None or channel.unit or table.unit(channel.column):
        return times_s * _factor(table, "t_s", channel, findings, None) + channel.offset
    unit_s = calendar_unit_s(times_s)
    if unit_s is None:
        return times_s * _factor(table, "t_s", channel, findings, None) + channel.offset
    findings.append(Finding("time", where, f"is a calendar time in steps of {unit_s:g} s: counted from the first row"))
    return (times_s - times_s[np.isfinite(times_s)][0]) * unit_s + channel.offset


def calendar_unit_s(times_s: Floats) -> float | None:
    """The unit in which a column without a unit counts calendar time [s]; None where it counts time of the run."""
    finite = times_s[np.isfinite(times_s)]
    if not len(finite):
        return None
    if np.ptp(finite) < _LONGEST_STEP * len(finite) and any(least <= finite[0] < most for least, most in _DAYS):
        return _DAY_S
    return next((unit_s for least, unit_s in _SINCE_1970 if finite[0] > least), None)


def without_sentinels(values: Floats, where: str, smooth: bool) -> tuple[Floats, list[Finding]]:
    """A column with NaN in place of sentinels, [rows].

    Args:
        values: the column of the file, [rows].
        where: file and column, for the finding.
        smooth: whether the measured quantity has no spikes.

    """
    small = np.where(np.abs(values) < _NO_VALUE, values, np.nan)
    if not np.isfinite(small).any():
        return small, []
    low, middle, high = np.nanquantile(small, (0.05, 0.5, 0.95))
    spread = float(high - low)
    away = np.abs(small - middle)
    bad = np.isfinite(values) & ~np.isfinite(small)
    if spread > 0.0 and float(np.nanmax(away)) > _FAR_ALIKE * spread:
        far = _leaps(small, away > _FAR_ALIKE * spread, 0.5 * _FAR_ALIKE * spread)
        if smooth:
            bad |= far & (away > _FAR_AWAY * spread)
        numbers, times = np.unique(values[~bad & far], return_counts=True)
        for value, again in zip(numbers.tolist(), (times > 1).tolist(), strict=True):
            if (smooth and again) or _NINES.fullmatch(f"{abs(value):.6f}".replace(".", "")):
                bad |= far & (values == value)
    rows = np.flatnonzero(bad)
    if not len(rows):
        return values, []
    text = f"{counted(len(rows), 'outlier')}, first row {rows[0] + 1} = {values[rows[0]]:.6g}: no measurement; left out"
    return np.where(bad, np.nan, values), [Finding("outlier", where, text, len(rows))]


def _leaps(values: Floats, far: npt.NDArray[np.bool_], least: float) -> npt.NDArray[np.bool_]:
    """Marks stretches of one constant far value that begin and end with a jump, [rows], which no motion does.

    A far value alone is not enough: a slide that rests for long and then moves goes far, too.
    """
    edges = np.diff(np.concatenate(([0], far.astype(np.int8), [0])))
    leaps = np.concatenate(([True], ~(np.abs(np.diff(values)) <= least), [True]))
    kept = np.zeros(len(values), np.bool_)
    for begin, end in zip(np.flatnonzero(edges > 0), np.flatnonzero(edges < 0), strict=True):
        kept[begin:end] = leaps[begin] and leaps[end] and (values[begin:end] == values[begin]).all()
    return kept
