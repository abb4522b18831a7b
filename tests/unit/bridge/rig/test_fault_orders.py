"""Fault orders of an operator to a running rig."""

import json
from typing import Any

import pytest

from bridge.faults import Fault
from bridge.rig.faults.schedule import Faults
from bridge.wire import stickslip_pb2 as wire


def faults() -> Faults:
    return Faults((), 1, 1e-3, 20)


def order(table: Any, **more: Any) -> bytes:
    text = table if isinstance(table, str) else json.dumps(table)
    return wire.Inject(fault=text, who="somebody", **more).SerializeToString()


OFF = {"kind": "off", "target": "drive_force_N", "for_s": 0.002}


def test_an_order_acts_from_its_block_on_and_is_taken_once() -> None:
    made = faults()
    for _ in range(3):
        made.take(order(OFF, id="a"), 5)
    reported: list[str] = []
    for block in range(4, 9):
        made.begin_block(block)
        reported += [f"{block} {code}" for code, _ in made.news()]
    assert reported == ["5 INJECTED", "7 INJECTION_ENDED"]


def test_clear_ends_present_and_future_faults() -> None:
    made = faults()
    made.take(order(OFF | {"for_s": 0.0}, id="a"), 1)
    made.take(order(OFF | {"from_s": 1.0}, id="b"), 1)
    made.begin_block(1)
    made.take(wire.Inject(clear=True, id="c").SerializeToString(), 2)
    made.begin_block(2)
    assert [code for code, _ in made.news()] == ["INJECTED", "INJECTION_ENDED"]
    assert not made.busy


@pytest.mark.parametrize(
    ("payload", "line"),
    [
        (b"\xff" * 12, "bytes cannot be decoded as Inject"),
        (order("[1"), "is not a JSON object"),
        (order("[" * 9000), "is not a JSON object"),
        (order([1]), "is not a JSON object"),
        (order(OFF | {"kind": "x"}), "kind = x: must fit target"),
        (order({"kind": "killed", "target": "controller"}), "a rig cannot end a process"),
        (order(OFF | {"for_s": 1e308}), "for_s = 1e.308: must be less than"),
        (order(OFF | {"from_s": 1e300}), "from_s = 1e.300: must be less than"),
        (order({"kind": "jump", "target": "clock", "value": -1e200}), "value = -1e.200: must be -1e.09 to 1e.09"),
    ],
)
def test_an_invalid_order_is_refused(payload: bytes, line: str) -> None:
    made = faults()
    with pytest.raises(Fault, match=line):
        made.take(payload, 1)
    assert not made.busy
