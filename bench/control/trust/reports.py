"""Events of rig and controller that report a fault or a limit, from the messages of a run."""

from bridge.guard.events import GuardEvents, changes
from bridge.wire.event_codes import EVENTS
from bridge.wire.words import CHECK, FAILURE, OUTSIDE
from cockpit.run.closed_loop import Stretch
from controller.trips.trip_events import TripEvents

_STATE = "GUARD"  # each change of the rig's state, also while it is healthy
_REPORTED = {FAILURE, CHECK, OUTSIDE}  # severities of a report


class Reports:
    """Collects the codes of events in the stretches of one run."""

    def __init__(self) -> None:
        self.codes: set[str] = set()
        self._guard, self._trips = GuardEvents(), TripEvents()

    def __call__(self, made: Stretch) -> None:
        """Collect the events of the next stretch."""
        trace = made.trace
        codes = {code for row in changes(made.applied) for code, _ in self._guard.news(made.applied[row])}
        codes |= {code for row in changes(trace, "reason") for code, _ in self._trips.news(trace[row])}
        self.codes |= {code for code in codes - {_STATE} if code in EVENTS and EVENTS[code].letter in _REPORTED}
