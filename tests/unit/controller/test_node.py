"""What a block does to the memory of the controller, without a bus."""

import pytest

from bridge.faults import Fault
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import BLOCK, LATE, sealed, sensor_block
from controller.node import ControllerNode
from tests.unit.controller.test_process import CONFIG, block


@pytest.mark.parametrize("lockstep", [False, True])
def test_a_pause_makes_a_block_late_only_where_the_rig_does_not_wait(lockstep: bool) -> None:
    """A late block changes what trips see: in lockstep the same run would have other bytes on a busy computer."""
    node = ControllerNode(CONFIG, lockstep)
    events: list[int] = []
    for number, arrival_ms in enumerate([1.0, 2.0, 103.0, 103.1]):
        node.block(block(number), round(arrival_ms * 1e6), round(arrival_ms * 1e6))
        events.append(wire.Trace.FromString(node.rest(0)[0].payload).events)
    assert events == [BLOCK, BLOCK, *([BLOCK] * 2 if lockstep else [BLOCK | LATE] * 2)]


def test_a_reset_forgets_a_pause_in_which_vibration_did_not_help() -> None:
    node = ControllerNode(CONFIG)
    state = node._state[0]
    for number, action in enumerate([None, None, wire.Operator.RESET]):
        if number == 1:
            state["off_left_s"][:], state["needless_from_mps"][:] = 60.0, 1e-4
        if action is not None:
            node.operator(action)
        node.block(block(number), 0)
        if number == 1:
            assert state["off_left_s"].min() > 59.0
    assert state["off_left_s"].max() == 0.0
    assert state["needless_from_mps"].max() == 0.0


def test_a_block_that_was_changed_on_its_way_is_refused_and_counts_as_lost() -> None:
    node = ControllerNode(CONFIG)
    whole = [sealed(sensor_block(20).canonical(block(number), "sensors")) for number in range(3)]
    assert node.block(block(0)) is not None  # a rig that gives no checksum
    assert node.block(whole[1]) is not None
    for at in (1, 10, 40, 200, 420, 430, 440, 452, 456):  # numbers, samples, the rig's state, the checksum and its tag
        changed = bytearray(whole[2])
        changed[at] ^= 0x10
        with pytest.raises(Fault, match="BAD_MESSAGE"):
            node.block(bytes(changed))
    with pytest.raises(Fault, match="checksum"):
        node.block(block(2))
    assert node.last_block == 1
    node.rig_was_away()
    assert node.block(block(2)) is not None
