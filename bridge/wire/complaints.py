"""Reports of bad messages: at most one event a second for each kind, with a count.

A client that sends 60 000 invalid messages a second must neither end a process nor fill its log, but must be reported.
"""

from collections.abc import Callable
from dataclasses import dataclass

from bridge.wire.clock import time

_EVERY_S = 1.0  # shortest time between two events of one kind; shorter: a flood fills logs and screens

# codes of the events
BAD_MESSAGE = "BAD_MESSAGE"  # undecodable or too many bytes, or meaningless numbers
FOREIGN = "FOREIGN"  # a valid message that no known process can have sent
FLOOD = "FLOOD"  # more messages than the process can read
CLOCK = "CLOCK"  # the times t_ns of the blocks do not match their numbers


@dataclass
class _Kind:
    """Counts of one kind of problem; code and place make a kind."""

    text: str = ""  # the newest problem of the kind
    times: int = 0
    pending: int = 0  # number of problems since the last event
    reported_s: float = -_EVERY_S


class Complaints:
    """Counts bad messages and reports them.

    Args:
        publish: publishes an event with a code and a text.
        clock: the time [s]; by default the clock of the process.

    """

    def __init__(self, publish: Callable[[str, str], object], clock: Callable[[], float] | None = None) -> None:
        self._publish = publish
        self._clock = clock or time.monotonic
        self._kinds: dict[tuple[str, str], _Kind] = {}

    def note(self, code: str, where: str, text: str, times: int = 1) -> None:
        """Count a problem: it is reported now, or together with others of its kind when 1 s has passed.

        Args:
            code: code of the event.
            where: forms the kind together with the code; one of a few places, never a received text.
            text: the problem and its consequence.
            times: number of occurrences.

        """
        kind = self._kinds.setdefault((code, where), _Kind())
        kind.text = text
        kind.times += times
        kind.pending += times
        self._report(code, where, kind)

    def report_when_due(self, all_of_it: bool = False) -> None:
        """Report problems that have waited for 1 s; with `all_of_it`, at the end of a process, all problems."""
        for (code, where), kind in self._kinds.items():
            if kind.pending:
                self._report(code, where, kind, all_of_it)

    def _report(self, code: str, where: str, kind: _Kind, at_once: bool = False) -> None:
        now_s = self._clock()
        if not at_once and now_s - kind.reported_s < _EVERY_S:
            return
        counts = [f"{kind.pending} times"] if kind.pending > 1 else []
        counts += [f"{kind.times} in all"] if kind.times > kind.pending else []
        count = f" ({', '.join(counts)})" if counts else ""
        kind.pending, kind.reported_s = 0, now_s
        self._publish(code, f"{where}: {kind.text}{count}")
