"""The codes of events on the bus and in logs: sender, severity, cause and remedy."""

import re
from collections.abc import Iterator
from typing import NamedTuple

from bridge.wire.words import CHECK, FAILURE, NEWS, SEVERITIES, help_of, source

# codes of letter C that a verdict lists nevertheless: a run with an injected fault does not show a healthy rig
TESTS = ("INJECTED", "INJECTION_ENDED")
# reasons, in a controller's commands, for a vibration without the wanted effect
WEAK_REASONS = ("EXCITER_END", "CANNOT_HELP", "PIEZO_WEAK", "HARMFUL")
# reasons that mark a sensor or the exciter as doubted; `controller.trips` detects them, and each is an event too
TRIPS = (
    *("OPEN_LOOP", "CLIPPED", "SWAPPED", "FROZEN", "RESONANCE"),
    *("FORCE_DOUBTED", "DRIVE_DOUBTED", "TRAVEL_END", "NOISE"),
    *("SLIDE_DOUBTED", "POSITIONS_APART", "JUMPED", "GAIN_OTHER", "DRIVE_UNSEEN"),
)


class EventCode(NamedTuple):
    """One row of `EVENTS`."""

    code: str
    sources: str  # senders: plant, controller, recorder; or the verdict
    letter: str  # severity, a key of SEVERITIES
    help: str


def _codes() -> Iterator[EventCode]:
    """The codes listed in `stickslip.proto`, and the trips."""
    listed = re.findall(r"^// ([A-Z_]+) \[([^\]]+)\] (?:([A-Z]): )?(.+)$", source(), re.MULTILINE)
    yield from (EventCode(*row) for row in listed)
    letters = {word: letter for letter, word in SEVERITIES.items()}
    for reason in TRIPS:
        severity, _, meaning = help_of("reason", reason).partition(": ")
        yield EventCode(reason, "controller", letters[severity], meaning)


EVENTS = {code.code: code for code in _codes()}


def event_code(code: str) -> EventCode:
    """The row of a code; for a code of another version a row of severity NEWS without a meaning."""
    return EVENTS.get(code) or EventCode(code, "", NEWS, "not known to this version")


def harms(code: str) -> bool:
    """Whether a run with such an event fails."""
    return code in EVENTS and EVENTS[code].letter == FAILURE


def is_listed(code: str) -> bool:
    """Whether a verdict lists the event: every code but news and checks, and also TESTS and codes of other versions."""
    return code not in EVENTS or EVENTS[code].letter not in {NEWS, CHECK} or code in TESTS
