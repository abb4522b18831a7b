"""The effect of a block on the controller's state, without a bus."""

import pytest

from bridge.faults import Fault
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import BLOCK, LATE, sealed, sensor_block
from controller.node import ControllerNode
from tests.unit.controller.fake_bus import CONFIG, MS, block


@pytest.mark.parametrize("lockstep", [False, True])
def test_a_pause_makes_a_block_late_only_where_the_rig_does_not_wait(lockstep: bool) -> None:
    """Late blocks are inputs of the trips: in lockstep they must not depend on how busy the computer is."""
    node = ControllerNode(CONFIG)
    events: list[int] = []
    for number, arrival_ms in enumerate([1.0, 2.0, 103.0, 103.1]):
        arrival_ns = round(arrival_ms * 1e6)
        node.block(block(number), arrival_ns, 0 if lockstep else arrival_ns)
        events.append(wire.Trace.FromString(node.rest(0)[0].payload).events)
    assert events == [BLOCK, BLOCK, *([BLOCK] * 2 if lockstep else [BLOCK | LATE] * 2)]


def test_a_reset_forgets_a_pause_in_which_vibration_did_not_help() -> None:
    node = ControllerNode(CONFIG)
    state = node._state[0]
    for number, action in enumerate([None, None, wire.Operator.RESET]):
        if number == 1:
            state["off_left_s"], state["needless_from_mps"] = 60.0, 1e-4
        if action is not None:
            node.operator(action)
        node.block(block(number), 0)
        if number == 1:
            assert state["off_left_s"] > 59.0
    assert state["off_left_s"] == 0.0
    assert state["needless_from_mps"] == 0.0


def test_a_block_that_was_changed_on_its_way_is_refused_and_counts_as_lost() -> None:
    node = ControllerNode(CONFIG)
    blocks = sensor_block(20).blank(3)
    for number in range(3):
        blocks[number] = sensor_block(20).read(block(number), "sensors")[0]
    blocks["applied_Hz"], blocks["applied_block"], blocks["guard_limit"] = 4500.0, 7, 20
    whole = [sealed(blocks[number : number + 1].tobytes()) for number in range(3)]
    assert node.block(block(0)) is not None  # a rig that gives no checksum
    assert node.block(whole[1]) is not None
    # numbers, samples, the rig's state, the checksum and its tag, the vibration in force
    for at in (1, 10, 40, 200, 420, 430, 440, 452, 456, 460, 470, 485):
        changed = bytearray(whole[2])
        changed[at] ^= 0x10
        with pytest.raises(Fault, match="BAD_MESSAGE"):
            node.block(bytes(changed))
    with pytest.raises(Fault, match="checksum"):
        node.block(block(2))
    assert node.last_block == 1
    node.rig_was_away()
    assert node.block(block(2)) is not None


def test_a_restarted_rig_is_accepted_after_eight_blocks() -> None:
    node = ControllerNode(CONFIG)
    for number in range(1000, 1300):
        assert node.block(block(number), number * MS) is not None
    assert node.block(block(1299 - 255), 1300 * MS) is None
    assert node.duplicates == 1
    answered = [node.block(block(number), (1400 + number) * MS) is not None for number in range(20)]
    assert answered == [False] * 7 + [True] * 13
    assert [code for code, _ in node.news()] == ["RIG_RESTARTED"]
    assert node.last_block == 19
    assert node._trace[0]["gap_blocks"] == 0
    assert node.t_ns == 20 * MS


def test_a_rig_that_was_away_is_accepted_at_its_first_block() -> None:
    node = ControllerNode(CONFIG)
    for number in range(100):
        node.block(block(number), number * MS)
    node.rig_was_away()
    assert node.block(block(0), 100 * MS) is not None
    assert node.news()[0] == ("RIG_RESTARTED", "block 0 after block 99: the controller continues with empty windows")


def test_blocks_of_another_length_are_refused() -> None:
    node = ControllerNode(CONFIG)
    node.block(block(0, 2.0))
    node.block(block(3, 2.0))  # the length is unknown across a gap
    node.stale(20)
    for number in (4, 5):  # one jump of the clock does not count as another length
        node.block(block(number, 2.0))
    with pytest.raises(Fault, match=r"CONFIG: sensors: blocks are 2 ms apart: must be block_s = 0.001 s; set"):
        node.block(block(6, 2.0))


@pytest.mark.parametrize("wrong_mps", [float("nan"), float("inf"), -1e300])
def test_an_announcement_of_an_invalid_velocity_is_refused(wrong_mps: float) -> None:
    node = ControllerNode(CONFIG)
    announced = wire.Announce(holds_from_ns=5, drive_velocity_mps=wrong_mps)
    with pytest.raises(Fault, match=r"BAD_MESSAGE: announce: drive_velocity_mps"):
        node.announcement(announced.SerializeToString())
    assert node._state[0]["announced_count"] == 0
