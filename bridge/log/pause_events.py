"""Stalls as events of a log: PAUSE of all cores, CORE_PAUSE of a single core, WATCH for the state of the stall watch."""

import re
from collections.abc import Iterable
from typing import NamedTuple

from bridge.wire import stickslip_pb2 as wire

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


def not_watched(events: Iterable[wire.Event]) -> str:
    """Why the computer's stalls are unknown in part or in whole; empty if they were watched to the end."""
    texts = [event.text for event in events if event.code == WATCH]
    if not texts:
        return "the recorder of this log did not watch them"
    prefixes = NOT_WATCHED, _NOT_WATCHED_BEFORE
    refused = [text.removeprefix(prefix) for text in texts for prefix in prefixes if text.startswith(prefix)]
    return refused[0] if refused else ""
