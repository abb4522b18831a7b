"""With a large effect the noise floors of the rig without the effect no longer apply."""

import numpy as np
import pytest

from diagnosis.fits.refits import refits
from diagnosis.fits.refloored import on_floor_of
from diagnosis.fits.retuning import ROUGHNESS, Retuned, expected_chi2
from diagnosis.hypotheses.catalogue import trials
from diagnosis.hypotheses.hypothesis import NOTHING
from tests.prepared import fitter_of, prepared

# nightly: 30 s; that a large effect is named at all is in the small set and in tests/system/test_diagnose.py
pytestmark = [pytest.mark.slow, pytest.mark.nightly]

SOFTER = -0.3


def test_a_right_effect_leaves_little_on_its_own_floors():
    effects = {"drive-stiffness": {"form": "", "ratio": SOFTER}}
    fitter = fitter_of(*prepared("ladder", effects))
    described = np.zeros(len(fitter.nuisances))
    (trial,) = [trial for trial in trials(fitter.problem) if trial.hypothesis.effects == ("drive-stiffness",)]
    (softer,) = refits(
        fitter, [(trial.hypothesis, described, np.array([SOFTER / trial.hypothesis.coordinates[0].scale]))], 1
    )
    without = fitter.refit(NOTHING, described, np.zeros(0))
    first = Retuned(fitter, without, ROUGHNESS, expected_chi2(fitter, without, ROUGHNESS, 1))
    again = on_floor_of(softer, first, [softer], [])
    (on_its_own,) = again.singles
    assert again.pairs == []
    assert softer.chi2 > 4.0 * first.expected_chi2  # which would be called unexplained
    assert on_its_own.chi2 < 2.5 * again.retuned.expected_chi2
    assert again.retuned.fit.chi2 > 20.0 * on_its_own.chi2
