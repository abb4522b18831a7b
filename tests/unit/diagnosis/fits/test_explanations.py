"""The search for fits, on a rig whose numbers a large effect has moved to their bounds."""

import math

import pytest

from bench.judge.rigs import drawn_rig
from diagnosis.judge.witnesses import before_fits, with_fits

GAIN = "force-sensor-gain"


@pytest.mark.nightly
def test_an_effect_that_gains_nothing_on_top_of_the_refitted_rig_is_found_from_the_described_one() -> None:
    rig = drawn_rig(42)  # the sensor reads 9.5 % too little; the refitted rig has two of its numbers at their bounds
    assert rig is not None
    assert rig.effects == (GAIN,)
    search = with_fits(before_fits(rig.evidence, 1, math.inf), lambda *_: None).search
    assert search is not None
    fit = search.fitted(frozenset((GAIN,)))
    assert fit is not None
    assert fit.chi2 < 0.6 * search.rig.fit.chi2
    ratio = fit.effects[GAIN]["ratio"]
    assert isinstance(ratio, float)
    assert -0.095 < ratio < -0.03
