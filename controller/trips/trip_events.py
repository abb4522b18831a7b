"""Events of the controller's trips and limits: the start of each, and the end of a trip."""

from typing import Any

import numpy as np
import numpy.typing as npt

from bridge.arrays import Records
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.event_codes import TRIPS, WEAK_REASONS
from bridge.wire.words import help_of, word_of

_LIMITS: dict[int, str] = {wire.RANGE: "STROKE_MAX", wire.GAIN_LIMIT: "GAIN_LIMIT"}
_HELD_S = 0.2  # duration of a limit until it is reported: every start of a vibration meets some limits
_STALLED = "; the computer or the link stalled within the last 0.15 s: check this cause first"
_AGAIN_S = 1.0  # least time between two reports of the same code


def changes(trace: Records) -> npt.NDArray[np.int64]:
    """Rows of a trace that may cause events: the first, rows that differ from the row before, and the last."""
    new = np.zeros(len(trace), bool)
    new[:1] = new[-1:] = True
    for name in ("reason", "limit"):
        new[1:] |= trace[name][1:] != trace[name][:-1]
    return np.flatnonzero(new)


class TripEvents:
    """Turns trips and limits of the steps into events."""

    def __init__(self) -> None:
        names = {wire.Reason.Value(name): name for name in (*TRIPS, *WEAK_REASONS)}
        self._reasons = {number: (name, help_of("reason", name)) for number, name in names.items()}
        self._limits = {number: (name, help_of("limit", word_of("limit", number))) for number, name in _LIMITS.items()}
        self._reason = self._limit = 0
        self._open: list[str] = []  # trips since the last step without a trip, as a trip may hide another
        self._limit_since_ns = 0
        self._limit_reported = True
        self._reported_ns: dict[str, int] = {}

    def news(self, trace: Any, stalled: bool = False) -> list[tuple[str, str]]:
        """Codes and texts of the trips and limits that a record of `Trace` begins or ends.

        Args:
            trace: the record.
            stalled: whether computer or link stalled within the last 0.15 s, which may be the cause.

        """
        reason, limit = int(trace.reason), int(trace.limit)
        if reason == self._reason and limit == self._limit and self._limit_reported:
            return []
        t_ns = int(trace.t_ns)
        events: list[tuple[str, str]] = []
        if reason != self._reason:
            self._reason = reason
            name, text = self._reasons.get(reason, ("", ""))
            if name in TRIPS:
                self._open = [*self._open, *([] if name in self._open else [name])]
            elif self._open:
                events.append(("CLEARED", f"{' and '.join(self._open)} {'is' if len(self._open) == 1 else 'are'} over"))
                self._open = []
            if name:
                events += self._once(name, f"{text}{_STALLED if stalled else ''}", t_ns)
        if limit != self._limit:
            self._limit, self._limit_since_ns, self._limit_reported = limit, t_ns, limit not in self._limits
        elif not self._limit_reported and t_ns - self._limit_since_ns >= _HELD_S * 1e9:
            self._limit_reported = True
            events += self._once(*self._limits[limit], t_ns)
        return events

    def _once(self, code: str, text: str, t_ns: int) -> list[tuple[str, str]]:
        if t_ns - self._reported_ns.get(code, -round(_AGAIN_S * 1e9)) < _AGAIN_S * 1e9:
            return []
        self._reported_ns[code] = t_ns
        return [(code, text)]
