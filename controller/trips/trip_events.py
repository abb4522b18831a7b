"""Events of the controller's trips: the start and the end of each."""

from typing import Any

from bridge.wire import stickslip_pb2 as wire
from bridge.wire.event_codes import TRIPS, WEAK_REASONS
from bridge.wire.words import help_of, word_of

_AGAIN_NS = 1_000_000_000  # least time between two reports of a weak effect, and between two reports of an end


class TripEvents:
    """Turns trips of the steps, and the end of the exciter, into events."""

    def __init__(self) -> None:
        self._reason = 0
        self._open: list[str] = []  # reported trips without a reported end, as a trip may hide another
        self._reported_ns: dict[str, int] = {}

    def news(self, trace: Any) -> list[tuple[str, str]]:
        """Codes and texts of the trips that a record of `Trace` begins or ends; a trip counts until CLEARED."""
        reason, limit, t_ns = int(trace["reason"]), int(trace["limit"]), int(trace["t_ns"])
        is_new, self._reason = reason != self._reason, reason
        if not is_new and not self._open:
            return []
        name = word_of("reason", reason)
        if name in TRIPS and name not in self._open:
            self._open.append(name)
            return [(name, help_of("reason", name))]
        events: list[tuple[str, str]] = []
        if self._open and name not in TRIPS and self._is_due("CLEARED", t_ns):
            events.append(("CLEARED", f"{' and '.join(self._open)} {'is' if len(self._open) == 1 else 'are'} over"))
            self._open = []
        if is_new and name in WEAK_REASONS and self._is_due(name, t_ns):
            with_cause = name == "EXCITER_END" and limit != wire.NO_LIMIT
            cause = f"; cause: {help_of('limit', word_of('limit', limit))}" if with_cause else ""
            events.append((name, f"{help_of('reason', name)}{cause}"))
        return events

    def _is_due(self, code: str, t_ns: int) -> bool:
        """Whether a code may be reported again; if so, it counts as reported now."""
        is_due = t_ns - self._reported_ns.get(code, -_AGAIN_NS) >= _AGAIN_NS
        self._reported_ns[code] = t_ns if is_due else self._reported_ns[code]
        return is_due
