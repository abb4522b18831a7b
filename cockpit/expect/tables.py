"""The tables `[[expect]]` and `[[must_fail]]` of a scenario."""

import math
import re
from collections.abc import Sequence
from difflib import get_close_matches
from typing import Annotated, Any, NamedTuple

from pydantic import BeforeValidator, Field, model_validator

from bridge.config import Strict
from bridge.rig.faults.table import FaultTable
from bridge.tables.unit_words import known_unit
from bridge.units import prefixed, unit_of
from bridge.wire.event_codes import EVENTS
from bridge.wire.words import words
from cockpit.figures.signals import SIGNALS, WORD_SIGNALS

STATES = {signal.title: signal for signal in WORD_SIGNALS if signal.title != "held by"}
EVENT_WORDS = {*EVENTS, *(row.word for row in words() if row.column in {"cause", "reason"})}
# signals that are never below 0: a lower limit of 0 or less, or an upper one below 0, is a mistake
NEVER_NEGATIVE = {
    *("vibration_velocity_mps", "wanted_velocity_mps", "velocity_ratio", "amplitude_m", "wanted_amplitude_m"),
    *("frequency_Hz", "time_to_slip_s", "round_trip_ns", "heat_share"),
}
_KINDS = ("signal", "event", "state", "slips", "surges")
_NUMBER = re.compile(r"\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*(\S.*?)?\s*")

_Time = Annotated[float, Field(ge=0, le=1e9)]
_Limit = float | str  # a number in the unit of the signal's name, or a text such as "80 nm"


def _several(given: Any) -> Any:
    return [given] if isinstance(given, str) else given


def _range(given: Any) -> Any:
    return (given, given) if isinstance(given, int) and not isinstance(given, bool) else given


_Words = Annotated[list[str], Field(min_length=1), BeforeValidator(_several, json_schema_input_type=str | list[str])]
_Count = Annotated[
    tuple[int, int], Field(strict=False), BeforeValidator(_range, json_schema_input_type=int | tuple[int, int])
]
_Pair = Annotated[tuple[_Limit, _Limit], Field(strict=False)]


class Limits(NamedTuple):
    """Lower and upper limit of a signal in its SI unit; infinite without one."""

    low: float
    high: float


class ExpectTable(Strict):
    """One expectation: a signal, an event, a state, or a number of slips or surges, in a window of the run."""

    name: str = Field(default="", pattern=r"^[^\x00-\x1f\x7f]*$", description="Name in reports; not given: in words.")
    requirement: str = Field(default="", description="Identifier of the requirement that it verifies, for reports.")
    signal: str = Field(default="", description="A signal as `stickslip plot --signals` names it, such as amplitude_m.")
    within: _Pair | None = Field(
        default=None, description='Limits of every sample: numbers in SI, or ["0 nm", "80 nm"].'
    )
    at_least: _Limit | None = Field(default=None, description="Lower limit of every sample.")
    at_most: _Limit | None = Field(default=None, description="Upper limit of every sample.")
    event: _Words | None = Field(default=None, description="An event, cause or lasting reason, or a list: any of them.")
    within_s: Annotated[float, Field(gt=0)] | None = Field(
        default=None, description="For an event: time from from_s within which it must occur."
    )
    state: str = Field(default="", description=f"One of {', '.join(STATES)}; with `is_in`.")
    is_in: _Words | None = Field(default=None, description="Allowed words of the state, such as ARMED.")
    slips: _Count | None = Field(default=None, description="Number of slips, or [fewest, most].")
    surges: _Count | None = Field(default=None, description="Number of surges that the controller counts, or a range.")
    from_s: _Time = Field(default=0.0, description="Begin of the window.")
    to_s: _Time | None = Field(default=None, description="End of the window; not given: the end of the run.")
    until_s: _Time | None = Field(
        default=None, description="It suffices that one sample meets the limits, from from_s until this time."
    )
    never: bool = Field(
        default=False, description="No sample may meet the limits or the state; the event may not occur."
    )
    in_charge: bool = Field(
        default=True, description="false: it counts although no controller is in charge, as in a run without one."
    )

    @model_validator(mode="after")
    def _is_an_expectation(self) -> "ExpectTable":
        kinds = [name for name in _KINDS if getattr(self, name) not in ("", None)]
        if len(kinds) != 1:
            keys = " and ".join(kinds) or "nothing to judge"
            raise ValueError(f"{keys} given: must be one of {', '.join(_KINDS)}; make an [[expect]] of each")
        self._refuse_other_keys(kinds[0])
        self._refuse_window()
        if self.signal:
            self._refuse_limits()
        for word in self.event or ():
            refuse_word("event", word, EVENT_WORDS)
        if self.state:
            refuse_word("state", self.state, STATES)
            known = [row.word for row in words() if row.column == STATES[self.state].column]
            for word in self.is_in or ():
                refuse_word("is_in", word, known)
            if set(self.is_in or ()) == set(known):
                raise ValueError(f"is_in: names every word of {self.state}, so it cannot fail; leave some out")
        for name in ("slips", "surges"):
            counts = getattr(self, name)
            if counts is not None and not 0 <= counts[0] <= counts[1]:
                rule = "must be the fewest, then the most, from 0 on"
                raise ValueError(f"{name} = [{counts[0]}, {counts[1]}]: {rule}; write for example {name} = [0, 2]")
        return self

    def _refuse_other_keys(self, kind: str) -> None:
        allowed = {
            "signal": {"within", "at_least", "at_most", "until_s", "never", "to_s"},
            "event": {"within_s", "never", "to_s"},
            "state": {"is_in", "until_s", "never", "to_s"},
        }.get(kind, {"to_s"})
        optional = ("within", "at_least", "at_most", "within_s", "is_in", "until_s", "never", "to_s")
        for name in optional:
            if name not in allowed and getattr(self, name) not in (None, False):
                raise ValueError(
                    f"{name}: has no meaning for {kind}, which takes {', '.join(sorted(allowed))}; leave it out"
                )
        if self.state and not self.is_in:
            raise ValueError("is_in: missing; add the allowed words of the state")
        if self.never and self.until_s is not None:
            raise ValueError(f"until_s = {self.until_s:g}: has no meaning with never; use to_s")
        if self.event and self.never == (self.within_s is not None):
            raise ValueError("event: must have either within_s or never = true; give one of them")
        if self.event and self.within_s is not None and self.to_s is not None:
            raise ValueError(f"to_s = {self.to_s:g}: the window of an event ends after within_s; leave it out")

    def _refuse_window(self) -> None:
        if self.to_s is not None and self.until_s is not None:
            raise ValueError(f"to_s = {self.to_s:g}: the window ends at until_s; leave one of them out")
        for name in ("to_s", "until_s"):
            end_s = getattr(self, name)
            if end_s is not None and end_s <= self.from_s:
                raise ValueError(f"{name} = {end_s:g}: must be after from_s = {self.from_s:g}; exchange them")

    def _refuse_limits(self) -> None:
        refuse_word("signal", self.signal, SIGNALS)
        if (self.within is None) == (self.at_least is None and self.at_most is None):
            raise ValueError(f"{self.signal}: must have within, or at_least or at_most; give a limit")
        low, high = self.limits
        if low > high:
            raise ValueError(f"limits {low:g} to {high:g}: the lower must come first; exchange them")
        if self.signal in NEVER_NEGATIVE:
            if high < 0.0 or (low < 0.0 and math.isfinite(low)):
                wrong = high if high < 0.0 else low
                raise ValueError(f"limit {wrong:g}: {self.signal} is never below 0; change its sign")
            if self.within is None and low == 0.0:
                raise ValueError(f"at_least = 0: {self.signal} is never below 0, so it cannot fail; raise it")

    @property
    def limits(self) -> Limits:
        """Limits of the signal in SI units. Raises ValueError for a wrong unit."""
        low, high = self.within or (self.at_least, self.at_most)
        return Limits(
            -math.inf if low is None else _si(low, self.signal), math.inf if high is None else _si(high, self.signal)
        )

    @property
    def end_s(self) -> float | None:
        """End of its window; None: the end of the run."""
        return self.from_s + self.within_s if self.within_s is not None else self.until_s or self.to_s

    def after(self, end_s: float) -> str:
        """Its first time as text that is not inside of a run that ends at `end_s`; else empty."""
        if self.from_s >= end_s:
            return f"from_s = {self.from_s:g}"
        own_s = self.end_s
        if own_s is None or own_s <= end_s * (1.0 + 1e-9):
            return ""
        name = next(name for name in ("within_s", "until_s", "to_s") if getattr(self, name) is not None)
        return f"{name} = {getattr(self, name):g}"

    def in_words(self) -> str:
        """Its name, or a short description."""
        return self.name or f"{self.what} {'never ' if self.never else ''}{self.wanted}".rstrip()

    @property
    def what(self) -> str:
        """The judged signal, state, event or count."""
        return self.signal or self.state or " or ".join(self.event or ()) or ("slips" if self.slips else "surges")

    @property
    def wanted(self) -> str:
        """The limit as text, with its unit."""
        if self.signal:
            return in_words(self.limits, unit_of(self.signal))
        counts = self.slips or self.surges
        if counts is not None:
            return f"{counts[0]}" if counts[0] == counts[1] else f"{counts[0]} to {counts[1]}"
        return f"within {self.within_s:g} s" if self.within_s is not None else " or ".join(self.is_in or ())


class MutantTable(Strict):
    """A defect under which an expectation of the scenario must fail: settings, faults, or both."""

    about: str = Field(default="", description="The defect in words.")
    settings: list[str] = Field(default=[], description="key=value each, as of --set.")
    fault: list[FaultTable] = Field(default=[], description="In addition to the faults of the scenario.")

    @model_validator(mode="after")
    def _changes_something(self) -> "MutantTable":
        if not (self.settings or self.fault):
            raise ValueError("must_fail: changes nothing: must have settings or fault; add one of them")
        return self

    def in_words(self) -> str:
        """The defect in words."""
        return self.about or ", ".join([*self.settings, *(table.in_words() for table in self.fault)])


def in_words(limits: Limits, unit: str) -> str:
    """Limits as text, with a prefix for the larger one."""
    unit = "" if unit == "1" else unit
    factor, unit = prefixed(max(abs(limit) for limit in limits if math.isfinite(limit)), unit)
    low, high = (f"{limit * factor:.6g}" for limit in limits)
    words = (
        f"at most {high}"
        if math.isinf(limits.low)
        else f"at least {low}"
        if math.isinf(limits.high)
        else f"{low} to {high}"
    )
    return f"{words} {unit}".rstrip()


def _si(limit: _Limit, signal: str) -> float:
    """A limit in the SI unit of a signal. Raises ValueError."""
    unit = unit_of(signal).replace("/s²", "/s2").replace("^2", "2")
    if not isinstance(limit, str):
        return float(limit)
    match = _NUMBER.fullmatch(limit)
    given = known_unit(match[2]) if match is not None and match[2] else None
    si_unit = known_unit(unit) if unit != "1" else None
    if match is None or given is None or si_unit is None or given[0] != si_unit[0]:
        rule = (
            "must be a number, as it has no unit"
            if unit == "1"
            else f"must be a number, or a text in a unit like {unit}"
        )
        raise ValueError(f"limit {limit!r} of {signal}: {rule}; change the limit")
    return float(match[1]) * given[1] / si_unit[1]


def refuse_word(key: str, word: str, known: Sequence[str] | set[str] | dict[str, Any]) -> None:
    """Raise ValueError for a word that is not known, with the nearest known one."""
    if word in known:
        return
    near = get_close_matches(word, [*known], 1, 0.6)
    remedy = f"perhaps {near[0]}" if near else f"known: {', '.join(sorted(known))}"
    raise ValueError(f"{key} = {word}: no such {'word' if key == 'is_in' else key}; {remedy}")
