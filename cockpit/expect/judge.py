"""Judges expectations on a finished log: PASSED, FAILED or UNTESTED.

Passing needs evidence: the samples of the whole window, a log without damage, and a controller in charge. A missing one makes
the result UNTESTED. A sample that breaks a limit makes it FAILED, however much of the log is missing.
"""

import math
from collections.abc import Sequence
from typing import Final, Literal, NamedTuple

import numpy as np

from bridge.arrays import Bools, Floats
from bridge.units import counted, unit_of
from bridge.wire.words import word_of, words
from cockpit.expect.record import Record, Samples
from cockpit.expect.tables import STATES, ExpectTable, Limits, in_words
from cockpit.judge.verdict import IN_CHARGE_SHARE, MISSING_SHARE

PASSED: Final = "PASSED"
FAILED: Final = "FAILED"
UNTESTED: Final = "UNTESTED"
Result = Literal["PASSED", "FAILED", "UNTESTED"]
# signals that mean nothing without a controller in charge for the whole window
_OF_CONTROL = {"velocity_ratio"}
# Ratio of the limits of a velocity to its largest value from which they are in another unit: 1.0 for 1 mm/s is 1000. 1000: 1.0
# for a drive of 1.1 mm/s passes. 100: a limit of 1 mm/s is refused for a drive that creeps at 10 um/s.
_OTHER_UNIT = 500.0


class Expected(NamedTuple):
    """The result of one expectation."""

    result: Result
    name: str
    requirement: str
    what: str  # signal, state, event or count
    value: float | str | None  # the sample, word, time or count that decides; None without one
    limit: str
    at_s: float | None  # time of the value in the run
    why: str

    def in_words(self) -> str:
        """A line: result, name, value, limit and time."""
        return f"{self.result:<8} {self.name}: {self.why}"


def judge(record: Record, expectations: Sequence[ExpectTable]) -> list[Expected]:
    """Results of expectations on a log, in their order."""
    return [_Judge(record, table).result() for table in expectations]


class _Judge:
    """One expectation on a log."""

    def __init__(self, record: Record, table: ExpectTable) -> None:
        self._record, self._table = record, table
        self._from_s = record.begin_s + table.from_s
        self._to_s = record.end_s if table.end_s is None else record.begin_s + table.end_s

    def result(self) -> Expected:
        table = self._table
        if table.event:
            return self._event(table.event)
        if table.slips is not None:
            return self._slips(table.slips)
        if table.surges is not None:
            return self._surges(table.surges)
        return self._state() if table.state else self._signal()

    def _made(self, result: Result, why: str, value: float | str | None = None, at_s: float | None = None) -> Expected:
        table = self._table
        return Expected(
            result, table.in_words(), table.requirement, table.what, value, table.wanted, at_s, f"{why}{self._window()}"
        )

    def _shown(self, value: float) -> str:
        return in_words(Limits(value, math.inf), unit_of(self._table.signal)).removeprefix("at least ")

    def _window(self) -> str:
        return f", in {self._from_s:g} to {self._to_s:g} s"

    def _passed(self, why: str, value: float | str | None, at_s: float | None, samples: Samples | None) -> Expected:
        """PASSED, if the log is evidence for it. `samples`: must cover the window; None: one sample suffices."""
        doubt = self._doubt(samples)
        return self._made(UNTESTED, f"{doubt} ({why})", value, at_s) if doubt else self._made(PASSED, why, value, at_s)

    def _doubt(self, samples: Samples | None) -> str:
        """Reason for which the log does not show that the expectation is met; else empty."""
        record, table = self._record, self._table
        if record.damage:
            return f"the log is damaged: {record.damage}"
        if samples is not None and (gap := self._gap(samples)):
            return gap
        if not table.in_charge:
            return ""
        needs_all = table.slips is not None or table.surges is not None or table.signal in _OF_CONTROL
        if needs_all:
            share = record.charge_share(self._from_s, self._to_s)
            if share < IN_CHARGE_SHARE:
                rule = f"the controller was in charge for {100 * share:.0f} % of the window"
                return f"{rule}: must be {100 * IN_CHARGE_SHARE:.0f} %; in_charge = false judges without it"
            if record.rests(self._from_s, self._to_s):
                return "the drive rests in the whole window, where nothing can slip"
        elif record.charge_share(0.0, math.inf if samples is None else self._to_s) == 0.0:
            until = f"until {self._to_s:g} s" if record.charge_share(0.0, math.inf) else "in the whole run"
            return f"no controller was in charge {until}; {record.why_not_in_charge}, or in_charge = false judges without it"
        return ""

    def _gap(self, samples: Samples) -> str:
        """Reason for which samples do not cover the window: more than 1 % of it, and more than 2 samples, are missing."""
        if samples.period_s <= 0.0:
            return "one sample does not cover the window"
        inside = (samples.t_s > self._from_s) & (samples.t_s <= self._to_s)
        t_s = np.concatenate([[self._from_s], samples.t_s[inside], [self._to_s]])
        steps_s = np.maximum(np.diff(t_s) - samples.period_s, 0.0)
        missing_s = float(steps_s[steps_s > 0.5 * samples.period_s].sum())
        if missing_s <= max(MISSING_SHARE * (self._to_s - self._from_s), 2.0 * samples.period_s):
            return ""
        return f"{missing_s:.3g} s of the window are missing in the log, which ends at {self._record.last_s:.2f} s"

    def _signal(self) -> Expected:
        table, name = self._table, self._table.signal
        samples = self._record.samples(name)
        if samples is None:
            return self._made(UNTESTED, f"{name} is not in the log")
        limits, possible = table.limits, self._record.range_of(name)
        around = limits.low <= possible.low and limits.high >= possible.high
        beyond = limits.low > possible.high or limits.high < possible.low
        if beyond if table.never else around:
            shown = in_words(possible, unit_of(name))
            wanted = f"{'never ' if table.never else ''}{table.wanted}"
            return self._made(UNTESTED, f"{name} cannot leave its range, {shown}: {wanted} cannot fail")
        inside = (samples.t_s > self._from_s) & (samples.t_s <= self._to_s) & samples.known
        t_s, values = samples.t_s[inside], samples.values[inside]
        if not len(values):
            return self._made(UNTESTED, f"the window holds no sample of {name}")
        known = np.abs(samples.values[samples.known & np.isfinite(samples.values)])
        largest, least = float(known.max(initial=0.0)), min(abs(limit) for limit in limits if math.isfinite(limit))
        if name.endswith("_mps") and 0.0 < _OTHER_UNIT * largest < least:
            why = f"{table.wanted} is {least / largest:.0f} times the largest value of the run: perhaps in another unit"
            return self._made(UNTESTED, why, largest)
        meets = (values >= limits.low) & (values <= limits.high)
        number = np.isfinite(values)
        if table.until_s is not None:
            if meets.any():
                at = int(np.argmax(meets))
                why = f"{self._shown(values[at])} at {t_s[at]:.4f} s, wanted {table.wanted}"
                return self._passed(why, float(values[at]), float(t_s[at]), None)
            return self._never_met(samples, t_s, values, limits)
        wrong = (meets if table.never else ~meets) & number
        if wrong.any():
            at = _worst(values, wrong, limits, table.never)
            why = (
                f"{self._shown(values[at])} at {t_s[at]:.4f} s, wanted {'never ' if table.never else ''}{table.wanted}"
            )
            count = int(np.count_nonzero(wrong))
            why += f"; {count} of {counted(len(values), 'sample')}, the first at {t_s[int(np.argmax(wrong))]:.4f} s"
            return self._made(FAILED, why, float(values[at]), float(t_s[at]))
        if not number.all():
            lost = int(np.count_nonzero(~number))
            at_s = float(t_s[int(np.argmin(number))])
            return self._made(
                UNTESTED, f"{lost} of {counted(len(values), 'sample')} of {name} are not a number", None, at_s
            )
        at = _worst(values, number, limits, table.never)
        why = f"{self._shown(values[at])} at {t_s[at]:.4f} s is nearest to the limit, {table.wanted}"
        return self._passed(why, float(values[at]), float(t_s[at]), samples)

    def _never_met(self, samples: Samples, t_s: Floats, values: Floats, limits: Limits) -> Expected:
        """The result where no sample meets the limits until the end of the window."""
        number = np.isfinite(values)
        gap = self._gap(samples)
        if gap or not number.all():
            lost = counted(int(np.count_nonzero(~number)), "sample")
            return self._made(UNTESTED, gap or f"{lost} of {self._table.signal} are not a number")
        distance = np.maximum(limits.low - values, values - limits.high)
        at = int(np.argmin(distance))
        why = f"no sample meets {self._table.wanted}; the nearest is {self._shown(values[at])} at {t_s[at]:.4f} s"
        return self._made(FAILED, why, float(values[at]), float(t_s[at]))

    def _state(self) -> Expected:
        table, name = self._table, self._table.state
        samples = self._record.states(name)
        if samples is None:
            return self._made(UNTESTED, f"{name} is not in the log")
        column = STATES[name].column
        allowed = [row.number for row in words() if row.column == column and row.word in (table.is_in or ())]
        inside = (samples.t_s > self._from_s) & (samples.t_s <= self._to_s)
        t_s, values = samples.t_s[inside], samples.values[inside]
        if not len(values):
            return self._made(UNTESTED, f"the window holds no sample of {name}")
        meets: Bools = np.isin(values, allowed)

        def at_of(rows: Bools) -> tuple[str, float]:
            at = int(np.argmax(rows))
            return word_of(column, int(values[at])), float(t_s[at])

        if table.until_s is not None:
            if meets.any():
                word, at_s = at_of(meets)
                return self._passed(f"{word} from {at_s:.4f} s on", word, at_s, None)
            gap = self._gap(samples)
            last = word_of(column, int(values[-1]))
            why = f"never {table.wanted}; {last} at the end of the window"
            return self._made(UNTESTED if gap else FAILED, gap or why, last, float(t_s[-1]))
        wrong = meets if table.never else ~meets
        if wrong.any():
            word, at_s = at_of(wrong)
            why = f"{word} at {at_s:.4f} s, wanted {'never ' if table.never else ''}{table.wanted}"
            return self._made(FAILED, why, word, at_s)
        word, at_s = at_of(~wrong)
        return self._passed(f"{word} and no other than allowed", word, at_s, samples)

    def _event(self, wanted: Sequence[str]) -> Expected:
        times = [(at_s, word) for word in wanted for at_s in self._record.events.get(word, ())]
        inside = sorted(row for row in times if self._from_s <= row[0] <= self._to_s)
        names = " or ".join(wanted)
        if self._table.never:
            if inside:
                at_s, word = inside[0]
                return self._made(FAILED, f"{word} at {at_s:.4f} s, {counted(len(inside), 'event')}", word, at_s)
            blocks = self._blocks()
            if blocks is None:
                return self._made(UNTESTED, "the log holds no block of the guard")
            return self._passed(f"no {names}", None, None, blocks)
        if inside:
            at_s, word = inside[0]
            why = f"{word} {at_s - self._from_s:.4f} s after {self._from_s:g} s, limit {self._table.within_s:g} s"
            return self._passed(why, word, at_s, None)
        gap = self._gap(blocks) if (blocks := self._blocks()) is not None else "the log holds no block"
        late = next((row for row in sorted(times) if row[0] > self._to_s), None)
        after = f"; the next {late[1]} is at {late[0]:.4f} s" if late is not None else ""
        others = [
            word for word, at_s in self._record.events.items() if any(self._from_s <= t_s <= self._to_s for t_s in at_s)
        ]
        only = f", only {', '.join(others)}" if others else ""
        return self._made(
            UNTESTED if gap else FAILED, gap or f"no {names}{only}{after}", None, late[0] if late else None
        )

    def _blocks(self) -> Samples | None:
        """The blocks of the log, whose gaps are gaps of the log."""
        return self._record.states("guard")

    def _slips(self, wanted: tuple[int, int]) -> Expected:
        at_s = self._record.slips_s
        if at_s is None:
            return self._made(UNTESTED, "the log holds no drive force")
        inside = at_s[(at_s > self._from_s) & (at_s <= self._to_s)]
        return self._counted("slip", len(inside), wanted, inside, self._record.samples("drive_force_N"))

    def _surges(self, wanted: tuple[int, int]) -> Expected:
        trace = self._record.run.trace
        if not len(trace):
            return self._made(UNTESTED, "the log holds no step of the controller")
        t_s = trace["t_ns"] * 1e-9
        rises = np.maximum(np.diff(trace["surges"].astype(np.int64), prepend=0), 0)
        inside = (t_s > self._from_s) & (t_s <= self._to_s)
        times_s = np.repeat(t_s[inside], rises[inside])
        samples = Samples(t_s, rises.astype(np.float64), np.ones(len(t_s), bool), self._record.block_s)
        return self._counted("surge", len(times_s), wanted, times_s, samples)

    def _counted(
        self, word: str, count: int, wanted: tuple[int, int], times_s: Floats, samples: Samples | None
    ) -> Expected:
        first_s = float(times_s[0]) if len(times_s) else None
        why = f"{counted(count, word)}, wanted {self._table.wanted}"
        why += f", the first at {first_s:.4f} s" if first_s is not None else ""
        if wanted[0] == 0 and wanted[1] * self._record.block_s >= self._to_s - self._from_s:
            return self._made(
                UNTESTED, f"{self._table.wanted}: is one a block or more, and cannot fail", count, first_s
            )
        if count > wanted[1]:
            return self._made(FAILED, why, count, first_s)
        if samples is None:
            return self._made(UNTESTED, f"the log does not contain the signal that shows each {word}")
        if count < wanted[0]:
            gap = self._gap(samples)
            return self._made(UNTESTED if gap else FAILED, gap or why, count, first_s)
        return self._passed(why, count, first_s, samples)


def _worst(values: Floats, among: Bools, limits: Limits, never: bool) -> int:
    """Index of the sample that is farthest outside of the limits, or nearest to them from inside; with `never` the reverse."""
    distance = np.maximum(limits.low - values, values - limits.high)
    return int(np.argmax(np.where(among, -distance if never else distance, -math.inf)))
