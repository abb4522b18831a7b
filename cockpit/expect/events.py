"""Words and times of the events in a log: codes, the causes in events of the guard, and reasons that last."""

import numpy as np

from bridge.log.in_charge import WEAK_S
from bridge.log.logfile import RunData, block_period_ns
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.event_codes import WEAK_REASONS


def word_of(event: wire.Event) -> str:
    """The code of an event, or the cause that the guard names: `BEFORE -> STATE: CAUSE: help` or `CAUSE: help`."""
    parts = event.text.split(": ")
    if event.code in {"GUARD", "FAULT"} and len(parts) > 1:
        return parts[1]
    return parts[0] if event.code == "HELD_BACK" else event.code


def times_of(run: RunData) -> dict[str, list[float]]:
    """Times of each word in a log [s], in order of time."""
    times: dict[str, list[float]] = {}
    for event in run.events:
        for word in {event.code, word_of(event)}:
            times.setdefault(word, []).append(event.t_ns * 1e-9)
    lost = np.flatnonzero(np.diff(run.sensors["sequence"].astype(np.int64)) > 1) + 1
    times.setdefault("GAP", []).extend((run.sensors["t_ns"][lost] * 1e-9).tolist())
    steps = max(round(WEAK_S * 1e9 / block_period_ns(run.sensors)), 1)
    for name in WEAK_REASONS:  # reported once they add up to as much time as makes a verdict fail
        rows = np.flatnonzero(run.trace["reason"] == wire.Reason.Value(name))
        if len(rows) >= steps:
            times.setdefault(name, []).append(float(run.trace["t_ns"][rows[steps - 1]]) * 1e-9)
    return {word: sorted(at_s) for word, at_s in times.items() if at_s}
