"""Which effects are given together, over made-up fits of which none imitates another."""

from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.fits.fit import Fit
from diagnosis.hypotheses.hypothesis import Coordinate, Hypothesis
from diagnosis.verdict.judge import RankedFit
from diagnosis.verdict.lookalikes import imitators

FEATURES = 100


def fit(effect, chi2):
    form = Hypothesis({effect: ""}, (Coordinate(effect, "ratio", 0.1, False, 1.0, -1.0, 1.0),))
    residual = np.full(FEATURES, (chi2 / FEATURES) ** 0.5)
    return Fit(form, np.zeros(2), np.zeros(1), chi2, residual, np.eye(FEATURES, 3))


class Fitter:
    """Stands in for a fitter: what an imitation leaves of perfect runs of the named effect, which itself leaves nothing."""

    def __init__(self, left):
        self.left = left
        self.problem = SimpleNamespace(measured=np.zeros(FEATURES))
        self.floor = SimpleNamespace(bias=np.zeros(FEATURES))

    def for_problem(self, *_):
        return self

    def predicted(self, *_):
        return np.zeros(FEATURES)

    def judged(self, named):
        return fit(named.hypothesis.effects[0], 0.0)

    def refit(self, form, *_):
        return fit(form.effects[0], self.left)


@pytest.mark.parametrize(
    ("behind", "left", "alike"),
    [(1.4, 200.0, True), (8.0, 200.0, False), (8.0, 4.0, True), (20.0, 4.0, False)],
    ids=["explains the runs as well", "does neither", "imitates it", "the runs tell"],
)
def test_a_group_holds_what_explains_the_runs_as_well_or_imitates_what_does(behind, left, alike):
    ranked = [RankedFit(fit("coulomb-level", 50.0), 100.0), RankedFit(fit("stribeck-velocity", 50.0), 100.0 - behind)]
    found = imitators(Fitter(left), ranked, 1.0)
    assert found == (("coulomb-level", "stribeck-velocity") if alike else ())
