"""The modes of the policy in stop-and-go; a pair that needs no vibration is not vibrated."""

from typing import Any

import pytest

from bridge.wire import stickslip_pb2 as wire
from tests.closed_loop.loop import Loop, close_the_loop

pytestmark = pytest.mark.slow

GO = [(0.0, 5e-4), (1.5, 5e-4), (1.55, 0.0), (2.5, 0.0), (2.55, 5e-4)]
PTFE = "C45-PTFE @ 0.063"


def _run(mode: str, pair: str = "C45-C45 @ 0.063", seconds: float = 4.0, **policy: Any) -> Loop:
    controller = {"policy": {"mode": mode, **policy}}
    return close_the_loop(seconds, rig={"drive": {"profile": GO}}, controller=controller, pair=pair)


def test_moving_vibrates_whenever_the_drive_moves_and_only_then() -> None:
    loop = _run("moving", PTFE)
    assert loop.excited(0.05, 1.5) == 1.0
    assert loop.reasons(0.05, 1.5) == {wire.MOVING}
    assert loop.excited(1.8, 2.5) == 0.0
    assert loop.excited(2.55) == 1.0
    assert wire.PROBE not in loop.modes()


@pytest.mark.parametrize("move_s", [1.5, 6.0])
def test_moves_that_need_no_vibration_have_none_after_a_trial(move_s: float) -> None:
    """Moves of 1.5 s vibrated for ever: the question needed seconds of one speed."""
    move = [(0.0, 0.0), (0.1, 5e-4), (move_s - 0.1, 5e-4), (move_s, 0.0), (move_s + 0.5, 0.0)]
    loop = close_the_loop(60.0, rig={"drive": {"profile": move, "repeat_every_s": move_s + 0.5}}, pair=PTFE)
    assert wire.PROBE in loop.modes()
    assert loop.excited(52.0) == 0.0
    assert loop.slips(0.0) == 0


def test_the_ratio_starts_at_the_set_point_and_falls_to_the_least() -> None:
    loop = close_the_loop(25.0)
    assert loop.trace["velocity_ratio"][loop.t_s < 0.5].max() == pytest.approx(1.2)
    assert loop.trace["velocity_ratio"][-1] == pytest.approx(1.07)
    assert loop.slips(0.0) == 0
    assert loop.ratio(24.0).mean() ** 2 < 1.17
