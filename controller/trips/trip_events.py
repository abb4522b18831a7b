"""Events of the controller's trips: the start and the end of each."""

from typing import Any

from bridge.wire import stickslip_pb2 as wire
from bridge.wire.event_codes import TRIPS, WEAK_REASONS
from bridge.wire.words import help_of, word_of

_AGAIN_NS = 1_000_000_000  # least time between two reports of the same code


class TripEvents:
    """Turns trips of the steps, and the end of the exciter, into events."""

    def __init__(self) -> None:
        self._reason = 0
        self._open: list[str] = []  # trips since the last step without a trip, as a trip may hide another
        self._reported_ns: dict[str, int] = {}

    def news(self, trace: Any) -> list[tuple[str, str]]:
        """Codes and texts of the trips that a record of `Trace` begins or ends."""
        reason, limit, t_ns = int(trace.reason), int(trace.limit), int(trace.t_ns)
        if reason == self._reason:
            return []
        self._reason, name = reason, word_of("reason", reason)
        events: list[tuple[str, str]] = []
        if name in TRIPS:
            self._open += [] if name in self._open else [name]
        elif self._open:
            events.append(("CLEARED", f"{' and '.join(self._open)} {'is' if len(self._open) == 1 else 'are'} over"))
            self._open = []
        if name in TRIPS + WEAK_REASONS and t_ns - self._reported_ns.get(name, -_AGAIN_NS) >= _AGAIN_NS:
            self._reported_ns[name] = t_ns
            with_cause = name == "EXCITER_END" and limit != wire.NO_LIMIT
            cause = f"; cause: {help_of('limit', word_of('limit', limit))}" if with_cause else ""
            events.append((name, f"{help_of('reason', name)}{cause}"))
        return events
