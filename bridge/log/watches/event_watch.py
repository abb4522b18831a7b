"""The events of a log: the first of each code, their numbers, the stalls, and the count of blocks in the plant's END."""

import re
from collections import Counter
from collections.abc import Iterable

from bridge.log.pause_events import CORE_PAUSE, PAUSE, RunPause, not_watched, pauses_of
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.event_codes import EVENTS, FAILURE, MAINTENANCE, OUTSIDE

# Most events of one source and code that are kept, to bound the memory. Stalls are all kept, as two numbers each.
KEPT = 20
_BLOCKS = re.compile(r"\bblocks=(\d{1,18})\b")  # in the plant's END; foreign rigs may leave it out
_WEIGHTY = {FAILURE, OUTSIDE, MAINTENANCE}


class EventWatch:
    """Collects the events of one log, in file order."""

    def __init__(self) -> None:
        self.kept: list[wire.Event] = []
        self.counts: Counter[tuple[str, str]] = Counter()  # by source and code
        self.pauses: list[RunPause] = []
        self.core_pauses: list[RunPause] = []

    def add(self, events: Iterable[wire.Event]) -> None:
        """Take events."""
        for event in events:
            if event.code in (PAUSE, CORE_PAUSE):
                (self.pauses if event.code == PAUSE else self.core_pauses).extend(pauses_of([event], event.code))
            self.counts[event.source, event.code] += 1
            if self.counts[event.source, event.code] <= KEPT:
                self.kept.append(event)

    @property
    def not_watched(self) -> str:
        """Why the computer's stalls are unknown in part or in whole; empty if they were watched to the end."""
        return not_watched(self.kept)

    @property
    def blocks_sent(self) -> int | None:
        """Number of blocks the plant sent, from its END; None without an END or without a count in it."""
        ends = (_BLOCKS.search(event.text) for event in self.kept if (event.source, event.code) == ("plant", "END"))
        counts = [int(end[1]) for end in ends if end]
        return counts[-1] if counts else None

    def has(self, source: str, code: str) -> bool:
        """Whether the log has an event of this source and code."""
        return self.counts[source, code] > 0


def is_weighty(code: str) -> bool:
    """Whether an event of this code is a finding of `log check`."""
    return code in EVENTS and EVENTS[code].letter in _WEIGHTY
