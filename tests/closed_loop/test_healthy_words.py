"""A healthy rig that an operator arms: its starts, stops and checks report no fault, and it vibrates as required."""

import numpy as np
import pytest

from bench.control.trust.reports import Reports
from bridge.wire import stickslip_pb2 as wire
from cockpit.run.closed_loop import ClosedLoop, Stretch
from cockpit.run.scenario import load_scenario

ARM, DISARM = wire.Operator.ARM, wire.Operator.DISARM


def played(name: str, seconds: float, words: dict[float, int]) -> tuple[set[str], list[Stretch]]:
    """Reports of guard and controller in a run with these operator `words` at these times, and its blocks."""
    scenario = load_scenario(name, ["controller.policy.enabled_from_s=0.0"])
    loop = ClosedLoop(scenario.rig, scenario.seed, scenario.controller, arm=False)
    block_s = scenario.rig.solver.block_s
    reports = Reports()
    parts: list[Stretch] = []
    for at_s, ends_s in zip(words, [*list(words)[1:], seconds], strict=True):
        if loop.block < round(at_s / block_s):
            parts.append(loop.advance(round(at_s / block_s) - loop.block))
        loop.apply_order(words[at_s])
        parts.append(loop.advance(round(ends_s / block_s) - loop.block))
    for part in parts:
        reports(part)
    return reports.codes, parts


@pytest.mark.parametrize("name", ["belt-axis", "ball-screw-axis"])
@pytest.mark.parametrize("at_s", [0.02, 4.02, 8.6])  # in a move, and before and in a dwell
def test_strokes_to_and_fro_raise_no_fault(name: str, at_s: float) -> None:
    codes, _ = played(name, 15.0, {at_s: ARM})
    assert codes == set()


def test_a_rig_that_is_armed_again_vibrates_as_before() -> None:
    codes, parts = played("from-the-start", 5.5, {0.02: ARM, 2.5: DISARM, 2.6: ARM})
    assert codes == set()
    before, after = (part.trace["vibration_velocity_mps"][-1000:] for part in (parts[1], parts[-1]))
    assert np.median(after) == pytest.approx(np.median(before), rel=0.1)
