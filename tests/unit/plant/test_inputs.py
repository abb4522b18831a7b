"""Inputs that a second thread draws ahead are those that are drawn when they are asked for."""

import numpy as np

from cockpit.run.scenario import load_scenario
from plant.inputs import Inputs, InputsAhead, RigInputs

PROFILE = "rig.drive.profile=[[0.0, 0.0005], [0.5, 0.0005], [0.6, 0.001]]"
RIG = load_scenario("from-the-start", [PROFILE, "rig.drive.announce_ahead_s=0.02", "rig.loop.jitter_s=0.004"]).rig


def test_whatever_stretches_are_asked_for() -> None:
    at_once = RigInputs(RIG, 7).draw(2500)
    ahead, drawn = InputsAhead(RigInputs(RIG, 7)), Inputs(*(part[:0] for part in at_once))
    for blocks in (0, 640, 640, 100, 1, 909, 0, 210):
        stretch = ahead.draw(blocks)
        assert len(stretch.noise) == blocks
        drawn = drawn.joined(stretch)
    assert len(at_once.announce) > 1
    for mine, theirs in zip(drawn, at_once, strict=True):
        assert mine.dtype == theirs.dtype
        assert np.array_equal(mine, theirs)
