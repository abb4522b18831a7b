"""The events of a log: the first of each code, their numbers, the stalls, and the count of blocks in the plant's END."""

import re
from collections import Counter
from collections.abc import Iterable

from bridge.log.pause_events import CORE_PAUSE, PAUSE, RunPause, not_watched, pauses_of
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.event_codes import EVENTS, FAILURE, MAINTENANCE, OUTSIDE

# Events of one source and code that are kept: a storm of them must not fill the memory, and no reader wants more. Stalls are all
# kept, as two numbers each.
KEPT = 20
_BLOCKS = re.compile(r"\bblocks=(\d{1,18})\b")  # in the plant's END; a foreign rig may leave it out
_WEIGHTY = {FAILURE, OUTSIDE, MAINTENANCE}


class EventWatch:
    """Looks at the events of one log, in file order."""

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
        """Why the stalls of the computer are not known, or not all of them; empty where they were watched to the end."""
        return not_watched(self.kept)

    @property
    def blocks_sent(self) -> int | None:
        """Blocks that the plant sent, by its END; None where the log has no END or the END no count."""
        ends = (_BLOCKS.search(event.text) for event in self.kept if (event.source, event.code) == ("plant", "END"))
        found = [int(end[1]) for end in ends if end]
        return found[-1] if found else None

    def has(self, source: str, code: str) -> bool:
        """Whether there was such an event."""
        return self.counts[source, code] > 0


def is_weighty(code: str) -> bool:
    """Whether an event of this code is a finding of `log check`."""
    return code in EVENTS and EVENTS[code].letter in _WEIGHTY
