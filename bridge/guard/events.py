"""Events of a rig's guard: each change of state with its reason, missing commands, active limits."""

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from bridge.arrays import Records
from bridge.guard.records import LIMITS
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.words import words

_AGAIN_S = 1.0  # shortest time between two reports of the same limit


def changes(records: Records, *fields: str) -> npt.NDArray[np.int64]:
    """Rows that may hold an event: the first, and each that differs in a field from the row before; by default of `Applied`."""
    new = np.zeros(len(records), bool)
    new[:1] = True
    for name in fields or ("guard_state", "guard_limit", "fallback"):
        new[1:] |= records[name][1:] != records[name][:-1]
    return np.flatnonzero(new)


class GuardEvents:
    """Turns the records of `Applied` into events, block by block; `gain_report` gives the gains of the last loop check."""

    def __init__(self, gain_report: Callable[[], str] = str) -> None:
        self._gain_report = gain_report
        self._help = {(word.column, word.number): f"{word.word}: {word.help}" for word in words()}
        self._state = -1
        self._limit = 0
        self._missing = 1  # commands count as missing from the start: no event before the first one
        self._fallback = False
        self._reported_s: dict[int, float] = {}

    def news(self, applied: Any) -> list[tuple[str, str]]:
        """Codes and texts of the new events in a record of `Applied`."""
        state, limit, missing = int(applied["guard_state"]), int(applied["guard_limit"]), int(applied["fallback"])
        if (state, limit, missing) == (self._state, self._limit, self._missing):
            return []
        events: list[tuple[str, str]] = []
        cause = int(applied["cause"])
        vibrates = state in (wire.ARMED, wire.ACTIVE)
        if vibrates and missing > self._missing:
            events.append(("FALLBACK", "no fresh command: ramping to zero"))
            self._fallback = True
        elif self._fallback and not missing:
            self._fallback = False
            events.append(("FRESH", "commands arrive again"))
        if state != self._state:
            before = f"{wire.GuardState.Name(self._state)} -> " if self._state >= 0 else ""
            text = f"{before}{wire.GuardState.Name(state)}: {self._help[('cause', cause)]}"
            tripped = state == wire.FAULT and cause not in (wire.STOP_BY_PERSON, wire.STOP_KEPT)
            events.append(("FAULT" if tripped else "GUARD", text))
            if state == wire.READY:
                text = self._help[("cause", cause)].partition(": ")[2]
                events.append((wire.Cause.Name(cause), f"{self._gain_report()}; {text}"))
        t_s = int(applied["t_ns"]) * 1e-9
        if limit != self._limit and limit in LIMITS and t_s - self._reported_s.get(limit, -_AGAIN_S) >= _AGAIN_S:
            self._reported_s[limit] = t_s
            events.append(("HELD_BACK", self._help[("cause", limit)]))
        self._state, self._limit, self._missing = state, limit, missing
        return events
