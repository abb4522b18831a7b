"""Which numbers of a stream of messages to believe: those that go on, and another count only when it goes on by itself."""

from enum import Enum

# Messages by which a late one may be behind, or that may be lost at once. Smaller: a longer loss counts as another sender for 8
# blocks. Larger: another sender whose count is as near is believed at once.
WINDOW = 256
# Another count is believed after so many messages in a row, each one further, while the present count has been silent for so
# long. Smaller: a burst of a stranger takes over. Larger: a rig that was restarted waits for longer.
_BELIEVED = 8
_SILENT_NS = 50_000_000
_DOUBTED = 64  # messages of another count from which they are strays though the present count is silent


class Verdict(Enum):
    """What a number says of its message."""

    NEXT = "next"  # it goes on, perhaps after a gap
    AGAIN = "again"  # it was there already, or was given up
    STRAY = "stray"  # of another count, which is not believed
    ANEW = "anew"  # the sender has begun again with lower numbers


class BlockNumbers:
    """Judges the numbers of one stream in the order of arrival."""

    def __init__(self) -> None:
        self.expected: int | None = None  # None before the first message, which may have any number
        self.strays = 0  # messages that were not believed for good
        self.jumped = False  # the newest that was taken is of another count than those before it
        self._doubted = 0  # messages of another count since the newest that was taken
        self._taken_ns = 0  # arrival of the newest message of the present count
        self._other = -1  # the newest number outside of the present count
        self._in_a_row = self._doubted = 0
        self.jumped = True
        self._may_begin_anew = False

    def sender_was_away(self) -> None:
        """The sender left the bus and came back: lower numbers are those of a new run at once."""
        self._may_begin_anew = True

    def judge(self, number: int, arrival_ns: int) -> Verdict:
        """Whether to take the message of this number, which came at `arrival_ns` (time.perf_counter_ns); sets `expected`."""
        ahead = number - self.expected if self.expected is not None else 0
        if 0 <= ahead <= WINDOW:
            self.strays += self._doubted
            self._take(number, arrival_ns)
            self.jumped = False
            return Verdict.NEXT
        if ahead < 0 and self._may_begin_anew:
            self._take(number, arrival_ns)
            return Verdict.ANEW
        self._in_a_row = self._in_a_row + 1 if number == self._other + 1 else 1
        self._other = number
        if self._in_a_row >= _BELIEVED and arrival_ns - self._taken_ns >= _SILENT_NS:
            self._take(number, arrival_ns)
            return Verdict.NEXT if ahead > 0 else Verdict.ANEW
        if -WINDOW <= ahead < 0:
            return Verdict.AGAIN
        self._doubted += 1
        if self._doubted >= _DOUBTED:
            self.strays, self._doubted = self.strays + self._doubted, 0
        return Verdict.STRAY

    def _take(self, number: int, arrival_ns: int) -> None:
        self.expected = number + 1
        self._taken_ns = arrival_ns
        self._in_a_row = self._doubted = 0
        self.jumped = True
        self._may_begin_anew = False
