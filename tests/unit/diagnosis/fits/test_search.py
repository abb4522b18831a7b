"""The search: a second effect beside a fit that is done, and a large effect that screening passes over."""

import numpy as np
import pytest

from diagnosis.fits.fit import Fit
from diagnosis.fits.gauss_newton import FAR_KNEE
from diagnosis.fits.screening import Directions, Origin, screened
from diagnosis.fits.search import pairs_with, refitted
from diagnosis.gap.floor import KNEE
from diagnosis.hypotheses.hypothesis import NOTHING
from diagnosis.hypotheses.trials import trials
from tests.prepared import fitter_of, prepared

EFFECTS = {"coulomb-level": {"ratio": -0.14}, "stribeck-velocity": {"ratio": -0.57}}


@pytest.mark.slow
# nightly: the rule is carried by whole diagnoses in the small set, a pair of effects among them
@pytest.mark.nightly
def test_a_second_effect_is_found_beside_one_that_is_there():
    fitter = fitter_of(*prepared("ladder", EFFECTS))
    described = np.zeros(len(fitter.nuisances))
    names = {"coulomb-level", "stribeck-velocity", "static-level"}
    tried = [one for one in trials(fitter.problem) if names.intersection(one.hypothesis.effects)]
    coulomb = next(one for one in tried if one.hypothesis.effects == ("coulomb-level",))
    first = fitter.refit(coulomb.hypothesis, described, coulomb.w)
    pairs = pairs_with(fitter, first, tried)
    assert set(pairs[0].hypothesis.effects) == set(EFFECTS)
    assert pairs[0].chi2 < 0.5 * first.chi2
    found = {name: table["ratio"] for name, table in pairs[0].effects.items()}
    assert found == {name: pytest.approx(table["ratio"], rel=0.2) for name, table in EFFECTS.items()}


@pytest.mark.slow
# nightly: the rule is carried by whole diagnoses in the small set, a pair of effects among them
@pytest.mark.nightly
def test_a_large_effect_that_screening_puts_last_is_tried_in_several_sizes():
    """Screening is linear: here it is made to see nothing in the static level, which it has behind eight others."""
    fitter = fitter_of(*prepared("short", {"static-level": {"ratio": 0.2}}))
    described = np.zeros(len(fitter.nuisances))
    tried = trials(fitter.problem)
    origins = [
        Origin(fitter.refit(NOTHING, described, described[:0]), KNEE),
        Origin(fitter.described(described), FAR_KNEE),
    ]
    few = {
        "static-level",
        "force-sensor-gain",
        "force-sensor-bias",
        "force-sensor-drift",
        "piezo-sag",
        "drive-stiffness",
        "accelerometer-gain",
        "direction-dependent-friction",
    }
    found = [
        sorted(some, key=lambda one: one.hypothesis.effects == ("static-level",))
        for some in screened(fitter, origins, [one for one in tried if set(one.hypothesis.effects) <= few])
    ]
    assert len(found[0]) > 8
    best = refitted(fitter, origins, found)[0]
    assert best.hypothesis.effects == ("static-level",)
    assert best.effects["static-level"]["ratio"] == pytest.approx(0.2, rel=0.2)


def test_a_nuisance_at_its_bound_does_not_take_what_an_effect_would():
    """A difference of 8 along the only nuisance's column, which has gone to its bound of 5."""
    along = np.array([1.0, 0.0, 0.0])
    fit = Fit(NOTHING, np.array([5.0]), np.zeros(0), 89.0, 8.0 * along, along[:, None])
    assert Directions(fit, np.array([5.0])).freed(along)[:3] == pytest.approx(along)
    assert np.linalg.norm(Directions(fit, np.array([6.0])).freed(along)) == pytest.approx(0.5**0.5)
