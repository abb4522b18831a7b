"""The search: a second effect in addition to a fitted effect, and a large effect that screening misses."""

import numpy as np
import pytest

from diagnosis.fits.fit import Fit
from diagnosis.fits.screening import Column, Directions, Screening, best_pairs, screened
from diagnosis.fits.search import pairs_of_effects, refitted
from diagnosis.hypotheses.catalogue import trials
from diagnosis.hypotheses.hypothesis import NOTHING, Coordinate, Hypothesis
from diagnosis.hypotheses.starts import Trial
from tests.prepared import fitter_of, prepared


def column(name: str, along: tuple[float, float]) -> Column:
    axis = Coordinate(name, "size", 1.0, False, 1.0, -10.0, 10.0)
    return Column(Trial(Hypothesis({name: ""}, (axis,)), np.ones(1)), np.array(along), np.array(along))


EFFECTS = {"coulomb-level": {"ratio": -0.14}, "stribeck-velocity": {"ratio": -0.57}}


@pytest.mark.slow
# nightly: the rule is carried by whole diagnoses in the small set, a pair of effects among them
@pytest.mark.nightly
def test_a_second_effect_is_found_in_addition_to_the_first():
    fitter = fitter_of(*prepared("ladder", EFFECTS))
    described = np.zeros(len(fitter.nuisances))
    names = {"coulomb-level", "stribeck-velocity", "static-level"}
    tried = [trial for trial in trials(fitter.problem) if names.intersection(trial.hypothesis.effects)]
    coulomb = next(trial for trial in tried if trial.hypothesis.effects == ("coulomb-level",))
    first = fitter.refit(coulomb.hypothesis, described, coulomb.w)
    pairs = pairs_of_effects(fitter, [first], Screening([], []), tried)
    assert set(pairs[0].hypothesis.effects) == set(EFFECTS)
    assert pairs[0].chi2 < 0.5 * first.chi2
    found = {name: table["ratio"] for name, table in pairs[0].effects.items()}
    assert found == {name: pytest.approx(table["ratio"], rel=0.2) for name, table in EFFECTS.items()}


@pytest.mark.slow
# nightly: the rule is carried by whole diagnoses in the small set, a pair of effects among them
@pytest.mark.nightly
def test_a_large_effect_that_screening_passes_over_is_tried_in_several_sizes():
    """Screening is linear: this test replaces its size of the static level by a small size of the wrong sign."""
    fitter = fitter_of(*prepared("short", {"static-level": {"ratio": 0.2}}))
    described = np.zeros(len(fitter.nuisances))
    base = fitter.refit(NOTHING, described, described[:0])
    tried = [trial for trial in trials(fitter.problem) if trial.hypothesis.effects == ("static-level",)]
    (seen,) = screened(fitter, base, tried).singles
    passed_over = Screening([seen._replace(w=-0.1 * seen.w, others=())], [])
    best = refitted(fitter, base.chi2, passed_over)[0]
    assert best.effects["static-level"]["ratio"] == pytest.approx(0.2, rel=0.2)


def test_a_pair_explains_more_than_either_effect_alone():
    """Two orthogonal directions span the difference; the third direction is a mixture of both."""
    columns = [column(name, along) for name, along in (("a", (2.0, 0.0)), ("b", (0.0, 1.0)), ("c", (1.0, 1.0)))]
    inner = np.array([column.direction for column in columns])
    left = np.array([6.0, 4.0])
    bounds = (np.full(3, -8.0), np.full(3, 8.0))
    found = best_pairs(columns, inner @ inner.T, inner @ left, bounds, float(left @ left))
    assert {frozenset(one[:2]) for one in found} == {frozenset(pair) for pair in ((0, 1), (0, 2), (1, 2))}
    by_pair = {frozenset(one[:2]): one for one in found}
    assert by_pair[frozenset((0, 1))][2] == pytest.approx([3.0, 4.0])
    assert by_pair[frozenset((0, 1))][3] == pytest.approx(0.0)


def test_a_nuisance_at_its_bound_does_not_absorb_an_effect():
    """A difference of 8 along the column of the only nuisance, which is at its bound of 5."""
    along = np.array([1.0, 0.0, 0.0])
    fit = Fit(NOTHING, np.array([5.0]), np.zeros(0), 89.0, 8.0 * along, along[:, None])
    assert Directions(fit, np.array([5.0])).freed(along)[:3] == pytest.approx(along)
    assert np.linalg.norm(Directions(fit, np.array([6.0])).freed(along)) == pytest.approx(0.5**0.5)
