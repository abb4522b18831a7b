"""The time in which the rig vibrates as commanded: from which blocks the controller learns."""

from typing import Any

import pytest

from bridge.wire.messages import BLOCK, NO_BLOCK, STALE, sensor_block
from bridge.wire.stickslip_pb2 import ACTIVE, BAND, COMMAND_LOST, DISARMED, DRIVE_RATIO, NO_CAUSE, SLEW_RATE
from controller.config import ControllerConfig
from controller.in_force import SETTLED_S, is_judged, is_settled, note_in_force
from controller.policy.need import raise_ratio
from controller.records import build

NANO = 1e-9
DELAY = 3  # blocks from a block to its command in force


class Loop:
    """A controller that has commanded 20 nm for long, and the blocks that state the vibration in force."""

    def __init__(self) -> None:
        params, memory = build(ControllerConfig())
        self.p: Any = params[0]
        self.s: Any = memory[0]
        self.s.sent_m[:] = 20.0 * NANO
        self.s.steps, self.s.quiet_s, self.s.settled_s = 1000, 10.0, 10.0

    def run(self, blocks: int, events: int = BLOCK, **fields: Any) -> None:
        """Blocks under the command of `DELAY` blocks before; `fields` replace their fields."""
        for _ in range(blocks):
            block = sensor_block(20).blank()
            number = int(self.s.steps)
            stated = {
                "applied_Hz": 4500.0,
                "applied_m": 20.0 * NANO,
                "applied_block": number - DELAY,
                "guard_state": ACTIVE,
            }
            for name, value in (stated | fields).items():
                block[name] = value
            block["sequence"] = number
            note_in_force(self.p, self.s, events, 0, block[0])
            self.s.steps += 1


def test_a_command_in_force_is_judged_at_once() -> None:
    loop = Loop()
    loop.run(1)
    assert is_judged(loop.s)


@pytest.mark.parametrize(
    "stated",
    [
        {"fallback": 1, "guard_limit": COMMAND_LOST},
        {"applied_m": 15 * NANO, "guard_limit": DRIVE_RATIO},
        {"applied_m": 0.0, "guard_limit": BAND},
        {"applied_m": 0.0, "guard_state": DISARMED, "guard_limit": SLEW_RATE},
        {"applied_block": NO_BLOCK, "fallback": 1},  # it vibrates without any command
        {"applied_m": 30 * NANO},
    ],
)
def test_nothing_is_judged_while_another_vibration_is_in_force_and_until_it_settled(stated: dict[str, Any]) -> None:
    loop = Loop()
    loop.run(5000, **stated)
    assert not is_judged(loop.s)  # also beyond the longest wait after stalls
    loop.run(int(1e3 * SETTLED_S) - 1)
    assert not is_judged(loop.s) or loop.s.stalling_s > 3.0
    loop.run(2)
    assert is_judged(loop.s)
    assert not is_settled(loop.s, 0.5)
    loop.run(1000)
    assert is_settled(loop.s, 0.5)


def test_the_slew_of_a_start_is_in_force_and_the_slew_after_an_interruption_is_not() -> None:
    loop = Loop()
    loop.run(10, applied_m=5 * NANO, guard_limit=SLEW_RATE)
    assert is_judged(loop.s)
    loop.run(1, fallback=1)
    loop.run(10, applied_m=5 * NANO, guard_limit=SLEW_RATE)
    assert loop.s.quiet_s == 0.0


def test_a_vibration_far_above_its_command_changes_no_ratio() -> None:
    """An exciter that delivered twice its command for 80 ms of every second raised v_a to 4 set points."""
    loop = Loop()
    loop.s.loud_steps = 1
    loop.run(1)
    assert is_judged(loop.s)  # the exciter may still be doubted
    assert not is_settled(loop.s, 0.0)
    loop.s.loud_steps = 0
    loop.run(round(1e3 * SETTLED_S) + 1)
    assert is_settled(loop.s, 0.0)


def test_a_rig_at_rest_before_its_first_command_is_judged() -> None:
    loop = Loop()
    loop.run(10, applied_m=0.0, applied_block=NO_BLOCK, fallback=1)
    assert is_judged(loop.s)


def test_a_rig_that_states_nothing_is_judged_except_after_stalls() -> None:
    loop = Loop()
    loop.run(10, applied_Hz=0.0, applied_m=0.0, applied_block=0, guard_limit=NO_CAUSE)
    assert is_judged(loop.s)
    loop.run(1, events=STALE)
    assert not is_judged(loop.s)


def test_without_a_slip_or_surge_the_ratio_stays_below_one_and_a_half_set_points() -> None:
    loop = Loop()
    loop.s.direction, loop.s.ratio[:] = 1, loop.p.v_ratio
    for _ in range(10):
        raise_ratio(loop.p, loop.s, 0.4)
    assert 1.2 * loop.p.v_ratio < loop.s.ratio[0] < 1.5 * loop.p.v_ratio
    loop.s.proven[:] = 1
    for _ in range(10):
        raise_ratio(loop.p, loop.s, 0.4)
    assert loop.s.ratio[0] == loop.p.most_ratio
