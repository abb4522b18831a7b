"""Events of the controller's trips: the start and the end of each."""

from typing import Any

from bridge.wire import stickslip_pb2 as wire
from bridge.wire.event_codes import TRIPS, WEAK_REASONS
from bridge.wire.words import help_of, word_of

_STALLED = "; the computer or the link stalled within the last 0.15 s: check this cause first"
_AGAIN_S = 1.0  # least time between two reports of the same code


class TripEvents:
    """Turns trips of the steps, and the end of the exciter, into events."""

    def __init__(self) -> None:
        names = {wire.Reason.Value(name): name for name in (*TRIPS, *WEAK_REASONS)}
        self._reasons = {number: (name, help_of("reason", name)) for number, name in names.items()}
        self._reason = 0
        self._open: list[str] = []  # trips since the last step without a trip, as a trip may hide another
        self._reported_ns: dict[str, int] = {}

    def news(self, trace: Any, stalled: bool = False) -> list[tuple[str, str]]:
        """Codes and texts of the trips that a record of `Trace` begins or ends.

        Args:
            trace: the record.
            stalled: whether computer or link stalled within the last 0.15 s, which may be the cause.

        """
        reason, limit = int(trace.reason), int(trace.limit)
        if reason == self._reason:
            return []
        events: list[tuple[str, str]] = []
        self._reason = reason
        name, text = self._reasons.get(reason, ("", ""))
        if name in TRIPS:
            self._open = [*self._open, *([] if name in self._open else [name])]
        elif self._open:
            events.append(("CLEARED", f"{' and '.join(self._open)} {'is' if len(self._open) == 1 else 'are'} over"))
            self._open = []
        if name == "EXCITER_END" and limit != wire.NO_LIMIT:
            text = f"{text}; cause: {help_of('limit', word_of('limit', limit))}"
        if name:
            events += self._once(name, f"{text}{_STALLED if stalled else ''}", int(trace.t_ns))
        return events

    def _once(self, code: str, text: str, t_ns: int) -> list[tuple[str, str]]:
        if t_ns - self._reported_ns.get(code, -round(_AGAIN_S * 1e9)) < _AGAIN_S * 1e9:
            return []
        self._reported_ns[code] = t_ns
        return [(code, text)]
