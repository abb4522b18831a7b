"""Numbers and times of one topic of a log: missing messages, duplicates, jumps of a clock."""

import numpy as np
import numpy.typing as npt

from bridge.log.finding import Finding
from bridge.units import counted
from bridge.wire.messages import Records

Integers = npt.NDArray[np.int64]
# Difference of t_ns and the message numbers up to which a clock is right; rounding to whole nanoseconds is far below.
_CLOCK_TOLERANCE_NS = 1000
_REMEMBERED_NUMBERS = 1 << 20  # missing numbers that are kept, to tell a late message from a duplicate; costs memory


class TopicWatch:
    """Checks one topic, message by message, in file order."""

    def __init__(self, topic: str) -> None:
        self.topic = topic
        self.messages = 0
        self.last_t_ns = 0
        self.first_number = 0
        self.restarts = 0
        self._missing_numbers: set[int] = set()
        self._gaps_for_good: list[range] = []  # gaps before a restart, and gaps too large to remember each number
        self._highest = -1
        self._duplicates: list[int] = []
        self._late: list[int] = []
        self._restarted_at: list[int] = []
        self._jumps: list[tuple[int, int]] = []  # number, by how much [ns]
        self._arrived_before: list[tuple[int, int]] = []
        self._last_number = -1
        self._last_log_time_ns = 0

    def add(self, records: Records, log_time_ns: Integers, period_ns: float) -> None:
        """Check the next messages.

        Args:
            records: of the topic, [messages].
            log_time_ns: time of arrival, [messages].
            period_ns: time between two numbers where the sender counts it; 0 where times only must not go back.

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
        step = np.diff(number, prepend=self._last_number)
        step_ns = np.diff(t_ns, prepend=self.last_t_ns)
        arrival_ns = np.diff(log_time_ns, prepend=self._last_log_time_ns)
        for i in np.flatnonzero(step != 1):
            self._odd_number(int(number[i]), int(number[i]) - int(step[i]))
        # the running maximum; `_odd_number` sets it back at a restart
        self._highest = max(self._highest, int(number[-1]))
        forward = step > 0
        jumped = np.abs(step_ns - period_ns * step) > _CLOCK_TOLERANCE_NS if period_ns else step_ns < 0
        self._jumps += [(int(number[i]), int(step_ns[i])) for i in np.flatnonzero(forward & jumped)]
        self._arrived_before += [(int(number[i]), int(arrival_ns[i])) for i in np.flatnonzero(arrival_ns < 0)]
        self.messages += len(number)
        self._last_number, self.last_t_ns = int(number[-1]), int(t_ns[-1])
        self._last_log_time_ns = int(log_time_ns[-1])

    def _odd_number(self, number: int, before: int) -> None:
        self._highest = max(self._highest, before)
        if number > self._highest + 1:
            gap = range(self._highest + 1, number)
            if len(self._missing_numbers) + len(gap) < _REMEMBERED_NUMBERS:
                self._missing_numbers.update(gap)
            else:
                self._gaps_for_good.append(gap)
            self._highest = number
        elif number == 0 and before > 0:
            self.restarts += 1
            self._restarted_at.append(before)
            self._gaps_for_good += _ranges(self._missing_numbers)
            self._missing_numbers.clear()
            self._highest = 0
        elif number in self._missing_numbers:
            self._missing_numbers.remove(number)
            self._late.append(number)
        elif number <= self._highest:
            self._duplicates.append(number)

    def findings(self) -> list[Finding]:
        """A finding for each kind of fault of the topic."""
        where = "/" + self.topic
        found: list[Finding] = []

        def add(kind: str, text: str, times: int) -> None:
            if times:
                found.append(Finding(kind, where, text, times))

        if self.restarts:
            ends = ", ".join(str(number) for number in self._restarted_at[:3])
            add(
                "two-runs",
                f"numbers start again at 0 after {ends}: {self.restarts + 1} runs in one file",
                self.restarts,
            )
        gaps = [*self._gaps_for_good, *_ranges(self._missing_numbers)]
        if gaps:
            missing = sum(len(gap) for gap in gaps)
            add(
                "gap",
                f"{counted(missing, 'message')} missing in {counted(len(gaps), 'gap')}, first {gaps[0][0]} to {gaps[0][-1]}",
                missing,
            )
        if self.topic == "sensors" and self.first_number > 0:
            add("gap", f"begins with block {self.first_number}: those before were not recorded", self.first_number)
        if self._duplicates:
            text = (
                f"numbers come a second time at {counted(len(self._duplicates), 'place')}, first {self._duplicates[0]}"
            )
            add("duplicate", text, len(self._duplicates))
        if self._late:
            add(
                "order",
                f"{counted(len(self._late), 'message')} came after a later one, first {self._late[0]}",
                len(self._late),
            )
        if self._jumps:
            number, step_ns = self._jumps[0]
            places = counted(len(self._jumps), "place")
            text = f"t_ns does not follow the numbers at {places}, first {number}: a step of {step_ns / 1e6:g} ms"
            add("clock-jump", text, len(self._jumps))
        if self._arrived_before:
            number, step_ns = self._arrived_before[0]
            places = counted(len(self._arrived_before), "place")
            text = f"log_time goes back at {places}, first {number}: by {-step_ns / 1e6:g} ms"
            add("log-time-back", text, len(self._arrived_before))
        return found


def _ranges(numbers: set[int]) -> list[range]:
    """The numbers as ranges without a gap, in order."""
    ordered = np.array(sorted(numbers), np.int64)
    return [
        range(int(own[0]), int(own[-1]) + 1)
        for own in np.split(ordered, np.flatnonzero(np.diff(ordered) > 1) + 1)
        if len(own)
    ]
