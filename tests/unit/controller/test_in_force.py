"""The time in which the rig vibrates as commanded: from which blocks the ratio changes."""

from typing import Any

import pytest

from bridge.wire.messages import BLOCK, LATE, NO_BLOCK, STALE, sensor_block
from bridge.wire.stickslip_pb2 import BAND, COMMAND_LOST, DRIVE_RATIO, NO_CAUSE, SLEW_RATE
from controller.config import ControllerConfig
from controller.in_force import SETTLED_S, is_settled, note_in_force
from controller.records import build

NANO = 1e-9


class Loop:
    """A controller that has commanded 20 nm for long, and the blocks that state the vibration in force."""

    def __init__(self) -> None:
        params, memory = build(ControllerConfig())
        self.p: Any = params[0]
        self.s: Any = memory[0]
        self.s.allowed_m, self.s.in_force_s = 20.0 * NANO, 10.0

    def run(self, blocks: int, events: int = BLOCK, **fields: Any) -> None:
        """Blocks under the commands; `fields` replace their fields."""
        for _ in range(blocks):
            block = sensor_block(20).blank()
            for name, value in ({"applied_Hz": 4500.0, "applied_m": 20.0 * NANO} | fields).items():
                block[name] = value
            note_in_force(self.p, self.s, events, block[0])


@pytest.mark.parametrize(
    "stated",
    [
        {"fallback": 1, "guard_limit": COMMAND_LOST},
        {"applied_m": 15 * NANO, "guard_limit": DRIVE_RATIO},
        {"applied_m": 0.0, "guard_limit": BAND},
        {"applied_block": NO_BLOCK, "fallback": 1},  # it vibrates without any command
    ],
)
def test_no_ratio_changes_while_another_vibration_is_in_force_and_until_the_slide_settled(
    stated: dict[str, Any],
) -> None:
    loop = Loop()
    loop.run(5000, **stated)
    assert not is_settled(loop.s, 0.0)
    loop.run(int(1e3 * SETTLED_S) - 1)
    assert not is_settled(loop.s, 0.0)
    loop.run(2)
    assert is_settled(loop.s, 0.0)
    assert not is_settled(loop.s, 0.5)
    loop.run(1000)
    assert is_settled(loop.s, 0.5)


@pytest.mark.parametrize(
    "stated",
    [
        {},
        {"applied_m": 5 * NANO, "guard_limit": SLEW_RATE},  # a normal start
        {"applied_Hz": 0.0, "applied_m": 0.0, "guard_limit": NO_CAUSE},  # a rig that states nothing
    ],
)
def test_a_command_in_force_interrupts_nothing(stated: dict[str, Any]) -> None:
    loop = Loop()
    loop.run(10, **stated)
    assert is_settled(loop.s, 0.0)


def test_a_rig_at_rest_before_its_first_command_interrupts_nothing() -> None:
    loop = Loop()
    loop.s.allowed_m = 0.0
    loop.run(10, applied_m=0.0, applied_block=NO_BLOCK, fallback=1)
    assert is_settled(loop.s, 0.0)


@pytest.mark.parametrize("event", [STALE, LATE])
def test_a_stall_is_an_interruption(event: int) -> None:
    loop = Loop()
    loop.run(1, events=event)
    assert not is_settled(loop.s, 0.0)
