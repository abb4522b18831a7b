"""Events of rig and controller that report a fault or a limit, from the messages of a run."""

import numpy as np

from bridge.guard.events import GuardEvents
from bridge.guard.events import changes as guard_changes
from bridge.wire.event_codes import EVENTS
from bridge.wire.words import CHECK, FAILURE, OUTSIDE
from cockpit.run.closed_loop import Stretch
from controller.trips.trip_events import TripEvents, changes

_STATE = "GUARD"  # each change of the rig's state, also while it is healthy
_REPORTED = {FAILURE, CHECK, OUTSIDE}  # severities of a report


class Reports:
    """Collects the codes of events in the stretches of one run."""

    def __init__(self) -> None:
        self.codes: set[str] = set()
        self._guard, self._trips, self._slips = GuardEvents(), TripEvents(), 0

    def __call__(self, made: Stretch) -> None:
        """Collect the events of the next stretch."""
        trace = made.trace
        codes = {code for row in guard_changes(made.applied) for code, _ in self._guard.news(made.applied[row])}
        codes |= {code for row in changes(trace) for code, _ in self._trips.news(trace[row])}
        slips = np.diff(trace["slips"].astype(np.int64), prepend=self._slips)
        if ((slips > 0) & (trace["drive_velocity_mps"] == 0.0)).any():
            codes.add("DRIVE_UNSEEN")
        self._slips = int(trace["slips"][-1]) if len(trace) else self._slips
        self.codes |= {code for code in codes - {_STATE} if code in EVENTS and EVENTS[code].letter in _REPORTED}
