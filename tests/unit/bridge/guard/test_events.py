"""Events of the guard: each change of state once, missing commands, each limit at most once a second."""

from typing import Any

import pytest

from bridge.guard.events import GuardEvents, changes
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import APPLIED
from bridge.wire.stickslip_pb2 import BAND, HEAT, SLEW_RATE


def applied(*rows: dict[str, Any]) -> Any:
    table = APPLIED.blank(len(rows))
    for i, row in enumerate(rows):
        table["t_ns"][i] = i * 100_000_000
        for name, value in row.items():
            table[name][i] = value
    return table


def codes_of(*rows: dict[str, Any]) -> list[list[str]]:
    """Codes of the events of every row. Rows that `changes` leaves out have none."""
    table, events, other = applied(*rows), GuardEvents(), GuardEvents()
    by_row = [[code for code, _ in events.news(row)] for row in table]
    picked = changes(table)
    assert [[code for code, _ in other.news(table[row])] for row in picked] == [by_row[row] for row in picked]
    assert all(not by_row[row] for row in set(range(len(table))) - set(picked.tolist()))
    return by_row


ARMED: dict[str, Any] = {"guard_state": wire.ARMED, "fallback": 1}
ACTIVE: dict[str, Any] = {"guard_state": wire.ACTIVE}


def test_every_change_of_state_is_reported_once_with_its_reason() -> None:
    fault = {"guard_state": wire.FAULT, "cause": wire.LOUD}
    assert codes_of(ARMED, ARMED, ACTIVE, ACTIVE, fault, fault) == [["GUARD"], [], ["GUARD"], [], ["FAULT"], []]
    events = GuardEvents()
    events.news(applied(ACTIVE)[0])
    assert events.news(applied(fault)[0])[0][1].startswith("ACTIVE -> FAULT: LOUD: failure: measured v_a above")


@pytest.mark.parametrize("cause", ["GAIN_CHANGED", "GAIN_UNEXPECTED"])
def test_another_gain_is_a_separate_event(cause: str) -> None:
    ready: dict[str, Any] = {"guard_state": wire.READY, "cause": wire.Cause.Value(cause)}
    assert codes_of(ARMED, ready, ready) == [["GUARD"], ["GUARD", cause], []]
    (_, (_, text)) = GuardEvents(lambda: "measured 0.1 at 2000 Hz").news(applied(ready)[0])
    assert text.startswith("measured 0.1 at 2000 Hz; ")


def test_missing_commands_are_reported_when_they_stop_and_when_they_return_but_not_before_the_first() -> None:
    lost = ACTIVE | {"fallback": 1}
    assert codes_of(ARMED, ACTIVE, lost, lost, ACTIVE, ACTIVE) == [
        ["GUARD"],
        ["GUARD"],
        ["FALLBACK"],
        [],
        ["FRESH"],
        [],
    ]


def test_the_same_limit_is_reported_once_a_second() -> None:
    band = ACTIVE | {"guard_limit": BAND}
    rows = [ACTIVE, *[band, ACTIVE] * 8]
    assert [row for row, codes in enumerate(codes_of(*rows)) if "HELD_BACK" in codes] == [1, 11]
    heat, slew = ACTIVE | {"guard_limit": HEAT}, ACTIVE | {"guard_limit": SLEW_RATE}
    assert codes_of(ACTIVE, band, heat, band, slew) == [["GUARD"], ["HELD_BACK"], ["HELD_BACK"], [], []]
