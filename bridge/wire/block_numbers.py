"""Check of the sequence numbers of a stream: a jump to another count is accepted only once that count continues steadily."""

from enum import Enum

# A number this far above the expected one continues the count after a loss; this far below, it is late or repeated. Smaller:
# after a longer loss the sender counts as another for 8 blocks. Larger: another sender with close numbers is accepted at once.
WINDOW = 256
# Another count is accepted after 8 consecutive numbers, if no message of the present count arrived for 50 ms. Smaller: a
# burst of another client takes over. Larger: a restarted rig waits longer.
_BELIEVED = 8
_SILENT_NS = 50_000_000
_DOUBTED = 64  # messages of another count that count as strays even if the present count does not continue


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
