"""Groups of effects that cannot be distinguished, over made-up fits."""

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
    """Fake of a fitter: an imitation leaves `left` of chi2 on perfect runs of the named effect, and that effect leaves 0."""

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
def test_a_group_holds_effects_that_fit_as_well_or_imitate_the_named_effect(behind, left, alike):
    ranked = [RankedFit(fit("coulomb-level", 50.0), 100.0), RankedFit(fit("stribeck-velocity", 50.0), 100.0 - behind)]
    group = imitators(Fitter(left), ranked, 1.0)
    assert group == (("coulomb-level", "stribeck-velocity") if alike else ())
