"""A table of measured data in memory: its columns as stored, their units, and their clocks."""

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bridge.arrays import Floats
from bridge.faults import Fault
from bridge.formula import Formula
from bridge.log.finding import Finding
from bridge.tables.cells import numbers, seconds
from bridge.tables.pieces import Segment, unwrapped
from bridge.tables.unit_words import bare_name, in_brackets, known_unit, unit_in_name
from bridge.units import counted

_SECONDS = re.compile(r"(.*?)(?:secs?|seconds)")  # column of the whole seconds of a stamp; see _NANOSECONDS
_AGAIN = re.compile(r"\.\d+$")  # suffix that a reader adds to a repeated name
_NANOSECONDS = ("nanosec", "nsec", "nsecs", "nanosecs", "nanoseconds")


class ChannelClock(NamedTuple):
    """The instants of a channel with a separate clock: `start_s + i * step_s`, or `times_s` [samples]."""

    start_s: float  # counted from the earliest start in the file
    step_s: float
    times_s: Floats | None = None

    def times(self, samples: int) -> Floats:
        """The instants of the samples [s], [samples]."""
        if self.times_s is not None:
            return self.times_s
        return self.start_s + self.step_s * np.arange(samples, dtype=np.float64)


@dataclass(frozen=True)
class Table:
    """The columns of one file. `findings` lists assumptions and omitted cells; it grows as columns are read."""

    path: Path
    columns: dict[str, Any]
    units: dict[str, str] = field(default_factory=dict[str, str])  # by column, as the file writes them
    # by channel; without an entry for a channel of the table's common clock
    clocks: dict[str, ChannelClock] = field(default_factory=dict[str, ChannelClock])
    sample_rate_Hz: float | None = None  # if the file states one rate for all channels
    decimal: str = "."  # decimal mark, and the mark of thousands, of numbers that are stored as text
    thousands: str = ""
    findings: list[Finding] = field(default_factory=list[Finding])
    written: dict[str, Any] = field(default_factory=dict[str, Any])  # how the file was read; keys of [source] of a map
    own_times: dict[str, str] = field(default_factory=dict[str, str])  # column of a channel's times, by channel
    segments: tuple[Segment, ...] = ()  # parts with a head each; empty for a file with one head
    derived: dict[str, list[str]] = field(
        default_factory=dict[str, list[str]]
    )  # columns of each formula that was asked for
    # numbers of the columns that were read: recognising the columns of a long record reads each several times
    _numbers: dict[str, Floats] = field(default_factory=dict[str, Floats], init=False, repr=False)
    names_are_paths: bool = (
        False  # of messages, structs and groups, where brackets hold an index or the name of a joint
    )

    def find(self, name: str | int) -> str:
        """The key of a column given by its name, its number from 1, its name without its unit, or a formula of columns.

        Raises Fault BAD_TABLE if no column matches, or more than one.
        """
        wanted = str(name)
        if wanted in self.columns:
            return wanted
        if wanted.isdigit() and 1 <= int(wanted) <= len(self.columns):
            return list(self.columns)[int(wanted) - 1]
        for bare in (False, True):
            near = [key for key in self.columns if _simplified(key, bare) == _simplified(wanted, bare)]
            if len(near) == 1:
                return near[0]
            if near:
                break
        if self._derive(wanted):
            return wanted
        known = ", ".join(self.columns) or "none"
        raise Fault("BAD_TABLE", f"{self.path.name}: column {wanted}: not in the file; known here: {known}")

    def _derive(self, text: str) -> bool:
        """Add the column of a formula, in SI units, with the clock of its first column; False for other texts."""
        try:
            formula = Formula(text)
            sources = [self.find(name) for name in sorted(formula.names)] if not Formula.is_name(text) else []
        except (ValueError, Fault):
            return False
        if not sources:
            return False
        factors = [known[1] if (known := known_unit(self.unit(source))) else 1.0 for source in sources]
        columns = [factor * self.column(source) for factor, source in zip(factors, sources, strict=True)]
        if len({len(column) for column in columns}) > 1:
            rows = ", ".join(f"{source}: {len(column)}" for source, column in zip(sources, columns, strict=True))
            raise Fault("BAD_TABLE", f"{self.path.name}: {text}: must have columns of equal length, rows {rows}")
        self.columns[text] = formula(dict(zip(sorted(formula.names), columns, strict=True)))
        self.derived[text] = sources
        if sources[0] in self.clocks:
            self.clocks[text] = self.clocks[sources[0]]
        self._add([Finding("derived", f"{self.path.name}: {text}", f"from {', '.join(sources)}, each in its SI unit")])
        return True

    def column(self, name: str | int) -> Floats:
        """One column, float64 [rows]; cells without a number are NaN. Raises Fault BAD_TABLE if it is missing or not numeric."""
        key = self.find(name)
        if key not in self._numbers:
            where = f"{self.path.name}: column {key}"
            self._numbers[key], findings = numbers(self.columns[key], where, self.decimal, self.thousands)
            self._add(findings)
        return self._numbers[key]

    def _add(self, findings: list[Finding]) -> None:
        self.findings.extend(finding for finding in findings if finding not in self.findings)

    def seconds(self, name: str | int) -> tuple[Floats, bool]:
        """A column of times in s from its first row, [rows], or of numbers unchanged; and whether it holds times.

        Raises Fault BAD_TABLE if it is missing, or holds neither.
        """
        key = self.find(name)
        where = f"{self.path.name}: column {key}"
        if nanoseconds := self._nanoseconds_of(key):
            whole_s = self.column(key)
            self._add([Finding("time", where, f"continues in column {nanoseconds}: both are one time")])
            # counted from the first row: seconds of the calendar would lose the digits of the nanoseconds
            times_s = whole_s - whole_s[:1] + 1e-9 * self.column(nanoseconds)
            return times_s - times_s[:1], True
        times_s, findings = seconds(self.columns[key], where)
        if times_s is None:
            counts, overflows = unwrapped(self.column(key))
            if overflows:
                text = f"its counter overflows {counted(overflows, 'time')}: counted on"
                self._add([Finding("time", where, text, overflows)])
            return counts, False
        self._add(findings)
        return times_s, True

    def _nanoseconds_of(self, key: str) -> str:
        """The column of nanoseconds that belongs to a column of whole seconds, as in a stamp of ROS; empty if missing."""
        stem = _SECONDS.fullmatch(key)
        return next((f"{stem[1]}{end}" for end in _NANOSECONDS if stem and f"{stem[1]}{end}" in self.columns), "")

    def unit(self, name: str | int) -> str:
        """The unit of a column: from the file's list of units, its name, or the given name, as in `T [ms]`; empty if unknown."""
        key = self.find(name)
        first = _AGAIN.sub("", key)
        if key in self.derived:
            return ""
        if (unit := self.units.get(key)) or (self.names_are_paths and key.endswith("]")):
            return unit or ""
        unit = unit_in_name(first if first in self.columns else key)
        return unit or ("" if str(name) == key else unit_in_name(str(name)))

    def stated_unit(self, name: str | int) -> str:
        """The unit of a column, known or not, as the file writes it; empty if it states none."""
        key = self.find(name)
        return self.unit(name) or ("" if self.names_are_paths or key in self.derived else in_brackets(key))


def _simplified(text: str, bare: bool) -> str:
    """The text with single blanks: without comment marks at its ends, or (`bare`) without its unit and its case."""
    return bare_name(text).casefold() if bare else re.sub(r"\s+", " ", text).strip("%# ")
