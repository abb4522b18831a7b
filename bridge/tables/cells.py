"""Cells of a stored column as numbers or as times: any other cell is NaN, and a finding reports its place."""

import calendar
import contextlib
import datetime as dt
import re
from collections.abc import Sequence
from typing import Any

import numpy as np
import pyarrow as pa

from bridge.arrays import Floats
from bridge.faults import Fault
from bridge.log.finding import Finding
from bridge.units import counted

_SHOWN = 60  # longest part of a cell that a finding shows [characters]
_MOST_BAD = 0.5  # share of non-empty cells without a number above which a column counts as text
# blanks and apostrophes that separate thousands; a dialect names only the first of each
BLANKS = (" ", "\xa0", "\u202f", "\u2009")
APOSTROPHES = ("'", "\u2019")
# hours, minutes and seconds, and milliseconds after a third colon (`:1` is 1 ms); or minutes and seconds, if a fraction follows
# the second number
_CLOCK = re.compile(r"(\d{1,3}):(\d{2})(?::(\d{2}(?:[.,]\d+|:\d{1,3}(?![\d:]))?)|([.,]\d+))?\s*([AaPp][Mm])?")
_DATE = re.compile(r"(\d{1,4})([-./])(\d{1,2})\2(\d{1,4})")
# a month by its English name or abbreviation, as MATLAB writes it: `05-Mar-2024`
_BY_NAME = re.compile(r"(\d{1,2})[- ./]([A-Za-z]{3,9})[- ./](\d{4}|\d{2})(?!\d)")
_MONTHS = {name.lower(): at for names in (calendar.month_abbr, calendar.month_name) for at, name in enumerate(names)}
_MONTHS["sept"] = 9
# orders of day, month and year; a date with slashes is American, unless the dates of the column exclude it
_ORDERS = ("mdy", "dmy", "ymd")
# lines of a head that state when a piece began
_STARTS = re.compile(r"start|begin|began|date|time|zeit|uhr|datum|beginn", re.IGNORECASE)
_DAY = re.compile(r"\d{1,4}([-./])\d{1,2}\1\d{1,4}|\d{1,2}[- ./][A-Za-z]{3,9}[- ./]\d{4}")
_ZONE = re.compile(r"\s*(?:Z|UTC|[+-]\d{2}:?\d{2})$")
_DAY_S, _HOUR_S = 86400.0, 3600.0


def numbers(values: Any, where: str, decimal: str, thousands: str) -> tuple[Floats, list[Finding]]:
    """A column as float64 [rows], NaN for a cell that is empty or not a number, and a finding for the cells without a number.

    Raises Fault BAD_TABLE if most cells are not numbers.
    """
    array = _array_of(values)
    if array.dtype.kind in "OUS":
        return _from_text(texts_of(array), where, decimal, thousands)
    if array.dtype.kind not in "fiub":
        raise Fault("BAD_TABLE", f"{where}: is {array.dtype}: must be numbers; name another column")
    return array.astype(np.float64), []


def _array_of(values: Any) -> Any:
    """A stored column as an array of NumPy: texts are objects, Arrow's numbers and truth values are float64."""
    if not isinstance(values, pa.ChunkedArray):
        return np.asarray(values)
    kind: Any = values.type
    with contextlib.suppress(pa.ArrowException):
        if not (pa.types.is_temporal(kind) or pa.types.is_string(kind) or pa.types.is_large_string(kind)):
            return values.cast(pa.float64(), safe=False).to_numpy()
    return values.to_numpy()


def texts_of(cells: Any) -> list[str]:
    """The cells of an array as texts; an empty cell is ""."""
    return ["" if cell is None else _as_text(cell) for cell in cells.ravel()]


def _as_text(cell: Any) -> str:
    if isinstance(cell, dt.date | dt.time):
        return cell.isoformat()
    return cell.decode(errors="replace") if isinstance(cell, bytes) else str(cell)


def number_in(text: str, decimal: str, thousands: str) -> float | None:
    """The number in a cell; None for a cell without a number."""
    word = text.strip()
    if thousands:
        for mark in BLANKS if thousands == " " else APOSTROPHES if thousands == "'" else (thousands,):
            word = word.replace(mark, "")
    if decimal != ".":
        if "." in word:
            return None
        word = word.replace(decimal, ".")
    try:
        return float(word) if "_" not in word else None
    except ValueError:
        try:  # Fortran writes 1.0D-3
            return float(word.replace("D", "E")) if re.fullmatch(r"[-+.\d]+D[-+]?\d+", word) else None
        except ValueError:
            return None


def _from_text(texts: list[str], where: str, decimal: str, thousands: str) -> tuple[Floats, list[Finding]]:
    result = np.full(len(texts), np.nan)
    bad: list[int] = []
    filled = 0
    for row, text in enumerate(texts):
        if not text.strip():
            continue
        filled += 1
        value = number_in(text, decimal, thousands)
        if value is None:
            bad.append(row)
        else:
            result[row] = value
    if not bad:
        return result, []
    # rows are counted from 1, below the names
    first = f"row {bad[0] + 1} = {texts[bad[0]][:_SHOWN]!r}"
    if len(bad) > _MOST_BAD * filled:
        raise Fault("BAD_TABLE", f"{where}: {first}: must be a number; name another column")
    return result, [
        Finding("not-finite", where, f"{counted(len(bad), 'cell')} without a number, first {first}; left out", len(bad))
    ]


def seconds(values: Any, where: str) -> tuple[Floats | None, list[Finding]]:
    """Times in a column, in s from its first one, [rows]; None if the column holds no times.

    Dates, clock times and both are read; clock times continue over midnight.
    """
    array = _array_of(values)
    kind = array.dtype.kind
    if kind in "US" or (kind == "O" and len(array) and not isinstance(array[0], int | float)):
        return _times_from_text(texts_of(array), where)
    if kind not in "mM":
        return None, []
    filled = ~np.isnat(array)
    stamps_ns = array.astype(f"{kind}8[ns]").astype(np.int64)
    since_s = (stamps_ns - stamps_ns[filled][:1].sum()) * 1e-9
    return np.where(filled, since_s, np.nan), [_time_finding(where)]


def _time_finding(where: str) -> Finding:
    return Finding("time", where, "holds times: counted in seconds from the first row")


def _times_from_text(texts: list[str], where: str) -> tuple[Floats | None, list[Finding]]:
    filled = next((text for text in texts if text.strip()), "")
    if not is_time(filled):
        return None, []
    texts = [_with_numbers(text) for text in texts] if _BY_NAME.search(filled) else texts
    order = _order_of(texts)
    stamps = [_time_in(text, order) for text in texts]
    # counted from the first day: seconds of the calendar would lose the digits of microseconds
    began = next((day for day, _ in filter(None, stamps)), 0)
    if filled.count(":") > 2 and _counts_frames(texts):
        return None, []
    times = [None if stamp is None else (stamp[0] - began) * _DAY_S + stamp[1] for stamp in stamps]
    if sum(time is None for time in times) > _MOST_BAD * len(texts):
        return None, []
    raw = np.array([np.nan if time is None else time for time in times])
    counted_on = raw if began else _counted_on(raw)
    first = counted_on[np.isfinite(counted_on)][0]
    bad = [row for row, time in enumerate(times) if time is None]
    findings = [_time_finding(where)]
    if bad:
        text = (
            f"{counted(len(bad), 'cell')} without a time, first row {bad[0] + 1} = {texts[bad[0]][:_SHOWN]!r}; left out"
        )
        findings.append(Finding("not-finite", where, text, len(bad)))
    return counted_on - first, findings


def _counts_frames(texts: list[str]) -> bool:
    """Whether frames or hundredths follow the third colon of clock times: milliseconds have three digits at least once."""
    thirds = [
        clock[3].partition(":")[2] for text in texts if (clock := _CLOCK.search(text)) and ":" in (clock[3] or "")
    ]
    return 0 < max(map(len, thirds), default=0) < 3


def _order_of(texts: list[str]) -> str:
    """The order of day, month and year in a column: valid for most dates, then with the shortest span of dates."""
    dates = {(date[2], *_numbers_of(date)) for text in texts if (date := _DATE.search(text)) is not None}
    slash = any(mark == "/" for mark, *_ in dates)

    def unlikely(order: str) -> tuple[int, int, bool]:
        days = [_day(parts, order) for _, *parts in dates]
        valid = [day for day in days if day is not None]
        return len(days) - len(valid), max(valid, default=0) - min(valid, default=0), not slash and order == "mdy"

    return min(_ORDERS, key=unlikely)


def _with_numbers(text: str) -> str:
    """A date with the name of a month in ISO form; other texts unchanged."""
    date = _BY_NAME.search(text)
    month = _MONTHS.get(date[2].lower()) if date else None
    if date is None or month is None:
        return text
    year = date[3] if len(date[3]) == 4 else f"20{date[3]}"
    return text.replace(date[0], f"{year}-{month:02d}-{date[1]}", 1)


def _numbers_of(date: re.Match[str]) -> tuple[int, int, int]:
    return int(date[1]), int(date[3]), int(date[4])


def _day(parts: Sequence[int], order: str) -> int | None:
    """The ordinal day of a date; None for an impossible date."""
    year, month, day = (parts[order.index(part)] for part in "ymd")
    try:
        return dt.date(year + (2000 if year < 100 else 0), month, day).toordinal()
    except ValueError:
        return None


def _time_in(text: str, order: str) -> tuple[int, float] | None:
    """Day (0 without a date) and second of a date, a clock time or both; None for other texts."""
    word = _ZONE.sub("", text.strip())
    clock = _CLOCK.search(word)
    date = _DATE.search(word)
    rest = word
    for match in (clock, date):
        if match is not None:
            rest = rest.replace(match[0], "", 1)
    if (clock is None and date is None) or rest.strip(" T,;\t"):
        return None
    day = 0 if date is None else _day(_numbers_of(date), order)
    if day is None:
        return None
    if clock is None:
        return day, 0.0
    if clock[4]:
        return day, 60.0 * int(clock[1]) + float((clock[2] + clock[4]).replace(",", "."))
    hours, minutes, (whole_s, _, milliseconds) = int(clock[1]), int(clock[2]), (clock[3] or "0").partition(":")
    if clock[5]:
        hours = hours % 12 + (12 if clock[5].lower() == "pm" else 0)
    secs = float(whole_s.replace(",", ".")) + 1e-3 * float(milliseconds or 0.0)
    return day, 3600.0 * hours + 60.0 * minutes + secs


def is_time(text: str) -> bool:
    """Whether a cell holds a date or a clock time."""
    return any(_time_in(_with_numbers(text), order) is not None for order in _ORDERS)


def _counted_on(times_s: Floats) -> Floats:
    """Clock times that continue over midnight, and minutes and seconds that continue over the hour, [rows]."""
    around_s = _DAY_S if np.nanmax(times_s, initial=0.0) >= _HOUR_S else _HOUR_S
    back = np.concatenate([[0.0], np.diff(times_s)]) < -0.5 * around_s
    return times_s + np.cumsum(back) * around_s


def starts_of(heads: Sequence[str]) -> list[float]:
    """The start that the head of each piece states, in s after the first piece; NaN without a clock time in a head.

    The last clock time of a head counts, as a program may write the creation of the file first; with the last date.
    """
    stamps: list[str] = []
    for head in heads:
        lines = [line for line in head.splitlines() if _STARTS.search(line)]
        clocks = [match[0] for line in lines for match in _CLOCK.finditer(line)]
        dates = [match[0] for line in lines for match in _DAY.finditer(line)]
        stamps.append(" ".join([*dates[-1:], *clocks[-1:]]) if clocks else "")
    if not all(stamps):
        return [np.nan] * len(stamps)
    times_s = _times_from_text(stamps, "")[0]
    return [np.nan] * len(stamps) if times_s is None else times_s.tolist()
