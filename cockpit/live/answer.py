"""State of a rig in one sentence."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from bridge.units import counted
from bridge.wire.event_codes import FAILURE, OUTSIDE, SEVERITIES, TRIPS, WEAK_REASONS, harms
from bridge.wire.words import help_of

GOOD, LOOK, BAD, OFF = "good", "look", "bad", "off"


class Answer(NamedTuple):
    """State of the rig in one sentence."""

    level: str  # GOOD, LOOK, BAD; OFF: no rig to report on
    text: str


def plain_help(column: str, word: str) -> str:
    """Meaning of a word in a column, for a screen or a page: without backticks."""
    return help_of(column, word).replace("`", "")


def of_a_live_rig(figures: Mapping[str, Any], slips: int, over_s: float) -> Answer:
    """Answer for a rig that sends blocks; `slips`: count over the last `over_s` [s]."""
    guard, cause = figures.get("guard_state"), figures.get("cause")
    mode, reason = figures.get("mode"), figures.get("reason")
    if guard == "FAULT":
        why = plain_help("cause", str(cause))
        more = "" if "reset" in why else "; nothing vibrates until a reset, then arm"
        return Answer(BAD, f"FAULT: {cause}: {why.partition(': ')[2]}{more}")
    if mode is None:
        return Answer(BAD, "no controller: the rig fades out by itself")
    if figures.get("fallback") and guard in {"ARMED", "ACTIVE", "NO_GUARD"}:
        return Answer(BAD, "the rig has no fresh command and ramps the vibration to zero by itself")
    if guard in {"DISARMED", "CHECKING", "READY"}:
        severity, _, why = plain_help("cause", str(cause)).partition(": ")
        more = f"; since {cause}: {why}" if severity in {SEVERITIES[FAILURE], SEVERITIES[OUTSIDE]} else ""
        return Answer(LOOK, f"{guard}: {plain_help('guard_state', guard)}{more}")
    summary = f"{mode}: {plain_help('mode', str(mode))}"
    if over_s >= 1.0:
        summary = f"{counted(slips, 'slip') if slips else 'no slip'} in the last {over_s:.0f} s; {summary}"
    if reason in {*WEAK_REASONS, *TRIPS}:
        return Answer(BAD if harms(str(reason)) else LOOK, f"{reason}: {plain_help('reason', str(reason))}; {summary}")
    return Answer(LOOK if slips else GOOD, summary)
