"""Writing the computer's stalls into the log that is being recorded, in the time of its run."""

import time

from bridge.log.pause_events import CORE_PAUSE, NOT_WATCHED, PAUSE, WATCH, in_words
from bridge.log.runlog import RunLog
from bridge.units import counted
from bridge.wire.messages import APPLIED as APPLIED_LAYOUT
from bridge.wire.pauses import Pause, PauseWatch
from bridge.wire.topics import APPLIED
from bridge.wire.zenoh_link import Received

_LOOK_S = 0.1  # between two looks at the timers; what a PAUSE on the bus comes late by
_EVERY = 10  # of so many messages of the plant one tells the time: 100 a second are enough for a clock
_WINDOW_NS = 1_000_000_000  # a clock of another computer drifts by some 0.05 ms in it


class RunClock:
    """The time of the run as this computer's clock tells it.

    A message comes later than it was due, never sooner: of the last one to two seconds the soonest counts. It was under way
    for some 0.1 to 0.2 ms, by which the time of the run is told too early.
    """

    def __init__(self) -> None:
        self._soonest: int | None = None
        self._before: int | None = None
        self._until_ns = 0

    def note(self, arrival_ns: int, due_ns: int) -> None:
        """A message that was due at `due_ns` of the run came at `arrival_ns` of time.perf_counter_ns."""
        began_ns = arrival_ns - due_ns
        if arrival_ns >= self._until_ns:
            self._until_ns, self._before, self._soonest = arrival_ns + _WINDOW_NS, self._soonest, None
        self._soonest = began_ns if self._soonest is None else min(self._soonest, began_ns)

    def run_ns(self, at_ns: int) -> int | None:
        """The time of the run at `at_ns` of time.perf_counter_ns; None before the first message."""
        known = [began_ns for began_ns in (self._soonest, self._before) if began_ns is not None]
        return at_ns - min(known) if known else None


class PauseWriter:
    """Writes the pauses that a watch sees into a log.

    Args:
        log: the log, which sends its events on the bus.
        watch: the timers.

    """

    def __init__(self, log: RunLog, watch: PauseWatch) -> None:
        self._log, self._watch = log, watch
        self._clock = RunClock()
        self._heard = 0
        self._refused = ""
        self._due_s = 0.0
        if not watch.refused:
            cores = ", ".join(map(str, watch.cores))
            text = f"stalls of the computer are watched on {counted(len(watch.cores), 'core')}: {cores}"
            log.add_event(WATCH, text, holds=True)

    def note(self, received: Received) -> None:
        """Set the clock after a message of the plant, and tell of pauses where it is time to look."""
        if received.topic is APPLIED:
            if self._heard % _EVERY == 0:
                applied = APPLIED_LAYOUT.read(received.payload, APPLIED.name)[0]
                self._clock.note(received.arrival_ns, int(applied.t_ns) + int(applied.late_ns))
            self._heard += 1
        self.tell_when_due()

    def tell_when_due(self) -> None:
        """Tell of pauses where it is time to look."""
        if time.monotonic() > self._due_s:
            self._due_s = time.monotonic() + _LOOK_S
            self._tell_all(self._watch.poll())

    def finish(self) -> None:
        """Tell of the last pauses."""
        self._tell_all(self._watch.poll(all_of_them=True))

    def _tell_all(self, pauses: list[Pause]) -> None:
        for pause in pauses:
            from_ns = self._clock.run_ns(pause.from_ns)
            if from_ns is not None and from_ns >= 0:
                code = PAUSE if pause.core is None else CORE_PAUSE
                self._log.add_event(code, in_words(pause.until_ns - pause.from_ns, pause.core), from_ns)
        if self._watch.refused and not self._refused:
            self._refused = self._watch.refused
            self._log.add_event(WATCH, NOT_WATCHED + self._refused, holds=True)
