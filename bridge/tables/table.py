"""A table of measured data in memory: its columns as they were stored, their units, and their own clocks."""

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.faults import Fault
from bridge.log.finding import Finding
from bridge.tables.cells import numbers, seconds
from bridge.tables.unit_words import bare_name, unit_in_name

Floats = npt.NDArray[np.float64]

_SECONDS = re.compile(r"(.*?)(?:secs?|seconds)")  # of a stamp, with one of these for what is over
_AGAIN = re.compile(r"\.\d+$")  # what a reader adds to a name that is in the file already
_NANOSECONDS = ("nanosec", "nsec", "nsecs", "nanosecs", "nanoseconds")


class Clock(NamedTuple):
    """When a channel with a clock of its own was sampled: `start_s + i * step_s`, or at `times_s` [samples]."""

    start_s: float  # after the earliest start of the file
    step_s: float
    times_s: Floats | None = None

    def times(self, samples: int) -> Floats:
        """The instants of the samples [s], [samples]."""
        if self.times_s is not None:
            return self.times_s
        return self.start_s + self.step_s * np.arange(samples, dtype=np.float64)


@dataclass(frozen=True)
class Table:
    """The columns of one file. `findings` grows as columns are read: what was assumed, and what was left out."""

    path: Path
    columns: dict[str, Any]
    units: dict[str, str] = field(default_factory=dict[str, str])  # by column, as the file writes them
    clocks: dict[str, Clock] = field(default_factory=dict[str, Clock])  # of the channels that have their own
    sample_rate_Hz: float | None = None  # where the file states one rate for all
    decimal: str = "."  # of numbers that are stored as text
    thousands: str = ""
    findings: list[Finding] = field(default_factory=list[Finding])
    written: dict[str, Any] = field(
        default_factory=dict[str, Any]
    )  # how the file is written: keys of [source] of a map
    own_times: dict[str, str] = field(
        default_factory=dict[str, str]
    )  # the columns of times that clocks come from, by channel

    def find(self, name: str | int) -> str:
        """The key of a column that a person names: its name, its number from 1 on, or its name without its unit.

        Raises Fault BAD_TABLE when no column, or more than one, is meant.
        """
        wanted = str(name)
        if wanted in self.columns:
            return wanted
        if wanted.isdigit() and 1 <= int(wanted) <= len(self.columns):
            return list(self.columns)[int(wanted) - 1]
        for same in (_squeezed, _bare):
            near = [key for key in self.columns if same(key) == same(wanted)]
            if len(near) == 1:
                return near[0]
            if near:
                break
        known = ", ".join(self.columns) or "none"
        raise Fault("BAD_TABLE", f"{self.path.name}: column {wanted}: not in the file; known here: {known}")

    def column(self, name: str | int) -> Floats:
        """One column, float64 [rows]; what is no number is NaN. Raises Fault BAD_TABLE when it is missing or not of numbers."""
        key = self.find(name)
        values, found = numbers(self.columns[key], f"{self.path.name}: column {key}", self.decimal, self.thousands)
        self.findings.extend(one for one in found if one not in self.findings)
        return values

    def seconds(self, name: str | int) -> tuple[Floats, bool]:
        """A column of times in s from its first row, [rows], or of numbers as they are; and whether it holds times.

        Raises Fault BAD_TABLE when it is missing, or holds neither.
        """
        key = self.find(name)
        where = f"{self.path.name}: column {key}"
        if nanoseconds := self._nanoseconds_beside(key):
            whole_s = self.column(key)
            found = [Finding("time", where, f"goes on in column {nanoseconds}: both are one time")]
            self.findings.extend(one for one in found if one not in self.findings)
            # a calendar in seconds would cost the digits of the nanoseconds
            times_s = whole_s - whole_s[:1] + 1e-9 * self.column(nanoseconds)
            return times_s - times_s[:1], True
        times_s, found = seconds(self.columns[key], where)
        if times_s is None:
            return self.column(key), False
        self.findings.extend(one for one in found if one not in self.findings)
        return times_s, True

    def _nanoseconds_beside(self, key: str) -> str:
        """The column of nanoseconds that belongs to one of whole seconds, as in a stamp of ROS; empty where there is none."""
        stem = _SECONDS.fullmatch(key)
        return next((f"{stem[1]}{end}" for end in _NANOSECONDS if stem and f"{stem[1]}{end}" in self.columns), "")

    def unit(self, name: str | int) -> str:
        """The unit of a column, from the file's own list or the column's name; empty where neither says one."""
        key = self.find(name)
        first = _AGAIN.sub("", key)
        return self.units.get(key) or unit_in_name(first if first in self.columns else key)


def _bare(text: str) -> str:
    return bare_name(text).casefold()


def _squeezed(text: str) -> str:
    """Without the marks of comments before it, and with single blanks."""
    return re.sub(r"\s+", " ", text).strip("%# ")
