"""The modes of the policy in stop-and-go; a pair that needs no vibration is not vibrated."""

from typing import Any

import numpy as np
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


def test_start_only_vibrates_after_each_start() -> None:
    loop = _run("start-only", start_s=0.3)
    assert loop.excited(0.02, 0.29) == 1.0
    assert loop.reasons(0.02, 0.29) == {wire.START_OF_MOVE}
    assert loop.excited(0.35, 1.5) == 0.0
    assert loop.excited(2.54, 2.78) == 1.0
    assert loop.excited(2.9) == 0.0


def test_settle_lets_the_vibration_die_out_after_a_move() -> None:
    loop = _run("settle", settle_s=0.4)
    settling = loop.trace[loop.trace["reason"] == wire.SETTLING]
    assert len(settling) == pytest.approx(400, abs=2)
    assert (np.diff(settling["wanted_velocity_mps"]) < 0.0).all()
    assert 0.2 * 1.2 * 5e-4 < settling["wanted_velocity_mps"][0] < 1.2 * 5e-4  # it has fallen with the drive
    assert loop.excited(2.1, 2.5) == 0.0
    assert _run("on-demand").excited(1.8, 2.5) == 0.0


def test_a_speed_found_needless_stays_needless_after_a_stop() -> None:
    profile = [
        (0.0, 5e-4),
        (6.0, 5e-4),
        (6.1, 0.0),
        (7.0, 0.0),
        (7.1, 5e-4),
        (9.0, 5e-4),
        (9.1, 0.0),
        (9.5, 0.0),
        (9.6, 5e-4),
    ]
    loop = close_the_loop(12.0, rig={"drive": {"profile": profile}}, pair=PTFE)
    assert loop.reasons(5.5, 6.0) == {wire.NOT_NEEDED}
    assert loop.excited(5.5) == 0.0
    assert loop.slips(0.0) == 0


def test_the_ratio_falls_to_the_least_and_stays_above_the_edge() -> None:
    loop = close_the_loop(25.0, controller={"policy": {"probe_every_s": 100.0, "first_probe_s": 100.0}})
    assert loop.trace["velocity_ratio"][loop.t_s > 0.1][0] == pytest.approx(1.2)
    assert loop.trace["velocity_ratio"][-1] == pytest.approx(1.07)
    assert loop.slips(0.0) == 0
    assert loop.ratio(24.0).mean() ** 2 < 1.17
