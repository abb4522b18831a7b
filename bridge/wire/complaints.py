"""Bad messages: reports, at most one event a second for each kind, with a count; check of the sequence numbers of a stream.

A client that sends 60 000 invalid messages a second must neither end a process nor fill its log, but must be reported. A jump to
another count is accepted only once that count continues steadily.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from bridge.wire.clock import time

_EVERY_S = 1.0  # shortest time between two events of one kind; shorter: a flood fills logs and screens

# codes of the events
BAD_MESSAGE = "BAD_MESSAGE"  # undecodable or too many bytes, or meaningless numbers
FOREIGN = "FOREIGN"  # a valid message that no known process can have sent
FLOOD = "FLOOD"  # more messages than the process can read
CLOCK = "CLOCK"  # the times t_ns of the blocks do not match their numbers

# A number this far above the expected one continues the count after a loss; this far below, it is late or repeated. Smaller:
# after a longer loss the sender counts as another for 8 blocks. Larger: another sender with close numbers is accepted at once.
WINDOW = 256
# Another count is accepted after 8 consecutive numbers, if no message of the present count arrived for 50 ms. Smaller: a
# burst of another client takes over. Larger: a restarted rig waits longer.
_BELIEVED = 8
_SILENT_NS = 50_000_000
_DOUBTED = 64  # messages of another count that count as strays even if the present count does not continue


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
        self._clock = clock
        self._kinds: dict[tuple[str, str], _Kind] = {}

    def note(self, code: str, where: str, text: str, times: int = 1) -> None:
        """Count a problem: it is reported now, or together with others of its kind when 1 s has passed.

        Args:
            code: code of the event.
            where: forms the kind together with the code; one of a few places, never a received text.
            text: the problem and its consequence.
            times: number of occurrences.

        """
        self._count(code, where, f"{where}: {text}", times)

    def order(self, action: str, who: str, how: str = "") -> None:
        """Count an operator's order by its action; the text of the event is `ARM by WHO`, which the sender waits for."""
        self._count("OPERATOR", action, f"{action} by {who or 'an unnamed operator'}{how}", 1)

    def _count(self, code: str, where: str, text: str, times: int) -> None:
        kind = self._kinds.setdefault((code, where), _Kind())
        kind.text = text
        kind.times += times
        kind.pending += times
        self._report(code, kind)

    def report_when_due(self, all_of_it: bool = False) -> None:
        """Report problems that have waited for 1 s; with `all_of_it`, at the end of a process, all problems."""
        for (code, _), kind in self._kinds.items():
            if kind.pending:
                self._report(code, kind, all_of_it)

    def _report(self, code: str, kind: _Kind, at_once: bool = False) -> None:
        now_s = (self._clock or time.monotonic)()  # the clock of now: a run may have begun simulated time since
        if not at_once and now_s - kind.reported_s < _EVERY_S:
            return
        counts = [f"{kind.pending} times"] if kind.pending > 1 else []
        counts += [f"{kind.times} in all"] if kind.times > kind.pending else []
        count = f" ({', '.join(counts)})" if counts else ""
        kind.pending, kind.reported_s = 0, now_s
        self._publish(code, f"{kind.text}{count}")


class NumberCheck(Enum):
    """The result of a check."""

    NEXT = "next"  # continues the count, perhaps after a gap
    AGAIN = "again"  # received already, or counted as lost
    STRAY = "stray"  # belongs to another count, which is not accepted
    ANEW = "anew"  # the sender restarted with lower numbers


class BlockNumbers:
    """Checks the numbers of one stream in the order of arrival."""

    def __init__(self) -> None:
        self.expected: int | None = None  # None before the first message, whose number is arbitrary
        self.strays = 0  # messages rejected so far
        self.jumped = True  # the newest accepted message began another count
        self._doubted = 0  # messages of another count since the newest accepted one
        self._taken_ns = 0  # arrival of the newest message of the present count (time.perf_counter_ns)
        self._stray = -1  # the newest number outside of the present count
        self._in_a_row = 0  # length of the run of consecutive numbers that ends with `_stray`
        self._may_begin_anew = False

    def sender_was_away(self) -> None:
        """Note that the sender left the bus and returned: lower numbers then begin a new run at once."""
        self._may_begin_anew = True

    def judge(self, number: int, arrival_ns: int) -> NumberCheck:
        """Check the number of a message that arrived at `arrival_ns` (time.perf_counter_ns); sets `expected`."""
        ahead = number - self.expected if self.expected is not None else 0
        if 0 <= ahead <= WINDOW:
            self.strays += self._doubted
            self._take(number, arrival_ns)
            self.jumped = False
            return NumberCheck.NEXT
        if ahead < 0 and self._may_begin_anew:
            self._take(number, arrival_ns)
            return NumberCheck.ANEW
        self._in_a_row = self._in_a_row + 1 if number == self._stray + 1 else 1
        self._stray = number
        if self._in_a_row >= _BELIEVED and arrival_ns - self._taken_ns >= _SILENT_NS:
            self._take(number, arrival_ns)
            return NumberCheck.NEXT if ahead > 0 else NumberCheck.ANEW
        if -WINDOW <= ahead < 0:
            return NumberCheck.AGAIN
        self._doubted += 1
        if self._doubted >= _DOUBTED:
            self.strays, self._doubted = self.strays + self._doubted, 0
        return NumberCheck.STRAY

    def _take(self, number: int, arrival_ns: int) -> None:
        self.expected = number + 1
        self._taken_ns = arrival_ns
        self._in_a_row = self._doubted = 0
        self.jumped = True
        self._may_begin_anew = False
