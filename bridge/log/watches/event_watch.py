"""The events of a log: the first of each code, their numbers, the stalls, and the count of blocks in the plant's END."""

import re
from collections import Counter
from collections.abc import Iterable
from typing import NamedTuple

from bridge.wire import stickslip_pb2 as wire

# Most events of one source and code that are kept, to bound the memory. Stalls are all kept, as two numbers each.
KEPT = 20
_BLOCKS = re.compile(r"\bblocks=(\d{1,18})\b")  # in the plant's END; foreign rigs may leave it out
PAUSE, CORE_PAUSE, WATCH = "PAUSE", "CORE_PAUSE", "WATCH"
NOT_WATCHED = "stalls of the computer not watched: "
_NOT_WATCHED_BEFORE = "pauses of the machine not watched: "  # in logs of earlier versions
_LENGTH = re.compile(r"\bfor (\d{1,12}\.\d{3}) ms\b")


class RunPause(NamedTuple):
    """A stall [ns of the run]."""

    from_ns: int
    until_ns: int


def in_words(length_ns: int, core: int | None) -> str:
    """The text of an event PAUSE, or of CORE_PAUSE if a single core stalled."""
    who = "the computer" if core is None else f"core {core}"
    return f"{who} stalled for {length_ns * 1e-6:.3f} ms"


def pauses_of(events: Iterable[wire.Event], code: str = PAUSE) -> list[RunPause]:
    """The stalls of the computer in a log, in order of time; with CORE_PAUSE the stalls of single cores."""
    stalls = [(event.t_ns, _LENGTH.search(event.text)) for event in events if event.code == code]
    return sorted(RunPause(t_ns, t_ns + round(float(length[1]) * 1e6)) for t_ns, length in stalls if length)


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
        texts = [event.text for event in self.kept if event.code == WATCH]
        if not texts:
            return "the recorder of this log did not watch them"
        prefixes = NOT_WATCHED, _NOT_WATCHED_BEFORE
        refused = [text.removeprefix(prefix) for text in texts for prefix in prefixes if text.startswith(prefix)]
        return refused[0] if refused else ""

    @property
    def blocks_sent(self) -> int | None:
        """Number of blocks the plant sent, from its END; None without an END or without a count in it."""
        ends = (_BLOCKS.search(event.text) for event in self.kept if (event.source, event.code) == ("plant", "END"))
        counts = [int(end[1]) for end in ends if end]
        return counts[-1] if counts else None

    def has(self, source: str, code: str) -> bool:
        """Whether the log has an event of this source and code."""
        return self.counts[source, code] > 0
