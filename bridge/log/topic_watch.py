"""Numbers and times of the messages of one topic: missing messages, duplicates, clock jumps."""

import numpy as np

from bridge.arrays import Indices, Records
from bridge.log.finding import Finding, findings_at
from bridge.log.watches.arrays import steps
from bridge.units import counted

# Tolerance between t_ns and the message numbers; rounding to whole nanoseconds stays far below it.
_CLOCK_TOLERANCE_NS = 1000
_REMEMBERED_NUMBERS = 1 << 20  # most missing numbers that are stored, to distinguish a late message from a duplicate

# Largest delay of a message, in numbers. A number 0 after a number above this starts a new run.
_LATEST = 256


class TopicWatch:
    """Checks the messages of one topic, in file order."""

    def __init__(self, topic: str) -> None:
        self.topic = topic
        self.messages = 0
        self.last_t_ns = 0
        self.first_number = 0
        self.restarts = 0
        self._missing_numbers: set[int] = set()
        self._gaps_for_good: list[range] = []  # gaps before a restart, and gaps too large to remember each number
        self._highest = -1
        self._duplicates = self._late = 0
        self._first_duplicate = self._first_late = 0
        self._restarted_at: list[int] = []
        self.jumps = self.standing = 0  # clock steps that do not follow the numbers; those among them that are 0
        self.first_jump = (0, 0)  # number, step less the expected one [ns]
        self._first_step_ns = 0
        self._arrived_before = 0
        self._first_before = (0, 0)
        self._last_number = -1
        self._last_log_time_ns = 0

    @property
    def missing(self) -> int:
        """Messages missing between the first and the last."""
        return len(self._missing_numbers) + sum(map(len, self._gaps_for_good))

    @property
    def end(self) -> int:
        """The number that follows the highest number so far."""
        return self._highest + 1

    def add(self, records: Records, log_time_ns: Indices, period_ns: float) -> None:
        """Check the next messages.

        Args:
            records: messages of the topic, [messages].
            log_time_ns: time of arrival, [messages].
            period_ns: time between two numbers if the sender counts it; 0 if times only must not go back.

        """
        if not len(records):
            return
        number = records["sequence"].astype(np.int64)
        t_ns = records["t_ns"]
        if self.messages == 0:
            self.first_number = int(number[0])
            self._last_number = self._highest = int(number[0]) - 1
            self._last_log_time_ns = int(log_time_ns[0])
            self.last_t_ns = int(t_ns[0]) - round(period_ns)
        step = steps(number, self._last_number)
        step_ns = steps(t_ns.astype(np.int64), self.last_t_ns)
        arrival_ns = steps(log_time_ns, self._last_log_time_ns)
        for i in np.flatnonzero(np.concatenate([[True], step[1:] != 1])):
            at = int(i)
            if step[at] != 1:
                self._odd_number(int(number[at]), int(number[at]) - int(step[at]))
                at += 1
            # consecutive late messages
            while at < len(number) and step[at] == 1 and number[at] <= self._highest:
                self._odd_number(int(number[at]), int(number[at]) - 1)
                at += 1
        # the running maximum; `_odd_number` resets it at a restart
        self._highest = max(self._highest, int(number[-1]))
        forward = step > 0
        excess_ns = step_ns - period_ns * step
        jumped = np.flatnonzero(forward & (np.abs(excess_ns) > _CLOCK_TOLERANCE_NS if period_ns else step_ns < 0))
        if len(jumped):
            if not self.jumps:
                self.first_jump = int(number[jumped[0]]), int(excess_ns[jumped[0]])
                self._first_step_ns = int(step_ns[jumped[0]])
            self.jumps += len(jumped)
            self.standing += int(np.count_nonzero(step_ns[jumped] == 0))
        if len(back := np.flatnonzero(arrival_ns < 0)):
            if not self._arrived_before:
                self._first_before = int(number[back[0]]), int(arrival_ns[back[0]])
            self._arrived_before += len(back)
        self.messages += len(number)
        self._last_number, self.last_t_ns = int(number[-1]), int(t_ns[-1])
        self._last_log_time_ns = int(log_time_ns[-1])

    def _odd_number(self, number: int, before: int) -> None:
        self._highest = max(self._highest, before)
        if number > self._highest + 1:
            self._gap(range(self._highest + 1, number))
            self._highest = number
        elif number == 0 and self._highest > _LATEST:
            self.restarts += 1
            self._restarted_at.append(before)
            self._gaps_for_good += _ranges(self._missing_numbers)
            self._missing_numbers.clear()
            self._highest = 0
        elif number in self._missing_numbers or number < self.first_number:
            self._missing_numbers.discard(number)
            if number < self.first_number:
                self._gap(range(number + 1, self.first_number))
                self.first_number = number
            self._first_late = self._first_late if self._late else number
            self._late += 1
        elif number <= self._highest:
            self._first_duplicate = self._first_duplicate if self._duplicates else number
            self._duplicates += 1

    def _gap(self, gap: range) -> None:
        if len(self._missing_numbers) + len(gap) < _REMEMBERED_NUMBERS:
            self._missing_numbers.update(gap)
        elif gap:
            self._gaps_for_good.append(gap)

    def findings(self) -> list[Finding]:
        """A finding for each kind of fault of the topic."""
        ends = ", ".join(str(number) for number in self._restarted_at[:3])
        gaps = [*self._gaps_for_good, *_ranges(self._missing_numbers)]
        places = ""
        if len(gaps) == 1:
            places = f": {gaps[0][0]}" + (f" to {gaps[0][-1]}" if len(gaps[0]) > 1 else "")
        elif gaps:
            places = f" in {len(gaps)} gaps, first {gaps[0][0]} to {gaps[0][-1]}"
        begins = max(self.first_number, 0) if self.topic == "sensors" else 0
        late, doubles = counted(self._late, "message"), counted(self._duplicates, "place")
        jumps, step = counted(self.jumps, "place"), f"a step of {self._first_step_ns / 1e6:g} ms"
        back, (back_at, back_ns) = counted(self._arrived_before, "place"), self._first_before
        rows = (
            ("two-runs", self.restarts, f"numbers start again at 0 after {ends}: {self.restarts + 1} runs in one file"),
            ("gap", self.missing, f"{counted(self.missing, 'message')} lost{places}"),
            ("gap", begins, f"begins with block {begins}: earlier blocks were not recorded"),
            ("duplicate", self._duplicates, f"repeated numbers at {doubles}, first {self._first_duplicate}"),
            ("order", self._late, f"{late} arrived after a later message, first {self._first_late}"),
            (
                "clock-jump",
                self.jumps,
                f"t_ns does not follow the numbers at {jumps}, first {self.first_jump[0]}: {step}",
            ),
            (
                "log-time-back",
                self._arrived_before,
                f"log_time goes back at {back}, first {back_at}: by {-back_ns / 1e6:g} ms",
            ),
        )
        return findings_at("/" + self.topic, rows)


def _ranges(numbers: set[int]) -> list[range]:
    """The numbers as contiguous ranges, in order."""
    ordered = np.array(sorted(numbers), np.int64)
    return [
        range(int(run[0]), int(run[-1]) + 1)
        for run in np.split(ordered, np.flatnonzero(np.diff(ordered) > 1) + 1)
        if len(run)
    ]
