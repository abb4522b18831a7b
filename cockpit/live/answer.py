"""The state of a rig in one sentence, and what the words of its columns mean."""

import functools
from collections.abc import Mapping
from typing import Any, NamedTuple

from bridge.units import counted
from bridge.wire.event_codes import FAILURE, OUTSIDE, TRIPS, WEAK_REASONS, harms
from bridge.wire.words import words

GOOD, LOOK, BAD, OFF = "good", "look", "bad", "off"


class Answer(NamedTuple):
    """The state in one sentence."""

    level: str  # GOOD, LOOK, BAD; OFF: there is nothing to be told of a rig now
    text: str


@functools.cache
def known() -> dict[tuple[str, int], tuple[str, str]]:
    """Word and meaning of each number, by column and number."""
    return {(one.column, one.number): (one.word, one.help.replace("`", "")) for one in words()}


def help_of(column: str, word: str) -> str:
    """What a word of a column means."""
    return next((told for (of, _), (one, told) in known().items() if (of, one) == (column, word)), "not known here")


def of_a_live_rig(figures: Mapping[str, Any], slips: int, over_s: float) -> Answer:
    """The answer of a rig that sends blocks, with its slips of the last `over_s` [s]."""
    guard, cause = figures.get("guard_state"), figures.get("cause")
    mode, reason = figures.get("mode"), figures.get("reason")
    if guard == "FAULT":
        why = help_of("cause", str(cause))
        more = "" if "reset" in why else "; nothing vibrates until a reset, then arm"
        return Answer(BAD, f"FAULT: {cause}: {why.partition(': ')[2]}{more}")
    if mode is None:
        return Answer(BAD, "no controller: nobody decides, and the rig fades out by itself")
    if figures.get("fallback") and guard in {"ARMED", "ACTIVE", "NO_GUARD"}:
        return Answer(BAD, "the rig has no fresh command and ramps the vibration to zero by itself")
    if guard in {"DISARMED", "CHECKING", "READY"}:
        letter, _, why = help_of("cause", str(cause)).partition(": ")
        more = f"; since {cause}: {why}" if letter in {FAILURE, OUTSIDE} else ""
        return Answer(LOOK, f"{guard}: {help_of('guard_state', guard)}{more}")
    told = f"{counted(slips, 'slip') if slips else 'no slip'} in the last {over_s:.0f} s"
    told += f"; {mode}: {help_of('mode', str(mode))}"
    if reason in {*WEAK_REASONS, *TRIPS}:
        return Answer(BAD if harms(str(reason)) else LOOK, f"{reason}: {help_of('reason', str(reason))}; {told}")
    return Answer(LOOK if slips else GOOD, told)
