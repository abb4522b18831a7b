"""Writing the computer's stalls into the log that is being recorded, in the time of its run."""

import time

from bridge.log.runlog import RunLog
from bridge.log.watches.event_watch import CORE_PAUSE, NOT_WATCHED, PAUSE, WATCH, in_words
from bridge.units import counted
from bridge.wire.messages import APPLIED as APPLIED_LAYOUT
from bridge.wire.pauses import Pause, PauseWatch
from bridge.wire.topics import APPLIED
from bridge.wire.zenoh_link import Received

_LOOK_S = 0.1  # time between two polls of the timers; a PAUSE is published with this delay
_EVERY = 10  # the clock is set by every tenth message of the plant: 100 a second are enough
_WINDOW_NS = 1_000_000_000  # window for the earliest message; another computer's clock drifts by 0.05 ms within it


class RunClock:
    """The time of the run on this computer's clock.

    A message arrives late, never early, so the earliest of the last one to two seconds counts. It travels for some 0.1 to 0.2 ms;
    the time of the run is too early by that much.
    """

    def __init__(self) -> None:
        self._soonest: int | None = None
        self._before: int | None = None
        self._until_ns = 0

    def note(self, arrival_ns: int, due_ns: int) -> None:
        """Note a message that was due at `due_ns` of the run and arrived at `arrival_ns` of time.perf_counter_ns."""
        began_ns = arrival_ns - due_ns
        if arrival_ns >= self._until_ns:
            self._until_ns, self._before, self._soonest = arrival_ns + _WINDOW_NS, self._soonest, None
        self._soonest = began_ns if self._soonest is None else min(self._soonest, began_ns)

    def run_ns(self, at_ns: int) -> int | None:
        """The time of the run at `at_ns` of time.perf_counter_ns; None before the first message."""
        known = [began_ns for began_ns in (self._soonest, self._before) if began_ns is not None]
        return at_ns - min(known) if known else None


class PauseWriter:
    """Writes the stalls reported by a watch into a log.

    Args:
        log: the log, which sends its events on the bus.
        watch: its timers find the stalls.

    """

    def __init__(self, log: RunLog, watch: PauseWatch) -> None:
        self._log, self._watch = log, watch
        self._clock = RunClock()
        self._applied = 0
        self._refused = ""
        self._due_s = 0.0
        if not watch.refused:
            cores = ", ".join(map(str, watch.cores))
            text = f"stalls of the computer are watched on {counted(len(watch.cores), 'core')}: {cores}"
            log.add_event(WATCH, text, holds=True)

    def note(self, received: Received) -> None:
        """Set the clock by a message of the plant, and write new stalls if a poll is due."""
        if received.topic is APPLIED:
            if self._applied % _EVERY == 0:
                applied = APPLIED_LAYOUT.read(received.payload, APPLIED.name)[0]
                self._clock.note(received.arrival_ns, int(applied.t_ns) + int(applied.late_ns))
            self._applied += 1
        self.report_when_due()

    def report_when_due(self) -> None:
        """Poll the timers if due, and write new stalls."""
        if time.monotonic() > self._due_s:
            self._due_s = time.monotonic() + _LOOK_S
            self._write_all(self._watch.poll())

    def finish(self) -> None:
        """Write the last stalls."""
        self._write_all(self._watch.poll(all_of_them=True))

    def _write_all(self, pauses: list[Pause]) -> None:
        for pause in pauses:
            from_ns = self._clock.run_ns(pause.from_ns)
            if from_ns is not None and from_ns >= 0:
                code = PAUSE if pause.core is None else CORE_PAUSE
                self._log.add_event(code, in_words(pause.until_ns - pause.from_ns, pause.core), from_ns)
        if self._watch.refused and not self._refused:
            self._refused = self._watch.refused
            self._log.add_event(WATCH, NOT_WATCHED + self._refused, holds=True)
