"""The search: a second effect beside a fit that is done, and a large effect that screening passes over."""

import numpy as np
import pytest

from diagnosis.fits.fit import Fit
from diagnosis.fits.screening import Column, Directions, Screening, best_pairs, screened
from diagnosis.fits.search import pairs_of_effects, refitted
from diagnosis.hypotheses.hypothesis import NOTHING, Coordinate, Hypothesis
from diagnosis.hypotheses.starts import Trial
from diagnosis.hypotheses.trials import trials
from tests.prepared import fitter_of, prepared


def column(name: str, along: tuple[float, float]) -> Column:
    axis = Coordinate(name, "size", 1.0, False, 1.0, -10.0, 10.0)
    return Column(Trial(Hypothesis({name: ""}, (axis,)), np.ones(1)), np.array(along), np.array(along))


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
    pairs = pairs_of_effects(fitter, [first], Screening([], []), tried)
    assert set(pairs[0].hypothesis.effects) == set(EFFECTS)
    assert pairs[0].chi2 < 0.5 * first.chi2
    found = {name: table["ratio"] for name, table in pairs[0].effects.items()}
    assert found == {name: pytest.approx(table["ratio"], rel=0.2) for name, table in EFFECTS.items()}


@pytest.mark.slow
# nightly: the rule is carried by whole diagnoses in the small set, a pair of effects among them
@pytest.mark.nightly
def test_a_large_effect_that_screening_passes_over_is_tried_in_several_sizes():
    """Screening is linear: here it is made to see next to nothing in the static level, and in the other direction."""
    fitter = fitter_of(*prepared("short", {"static-level": {"ratio": 0.2}}))
    described = np.zeros(len(fitter.nuisances))
    base = fitter.refit(NOTHING, described, described[:0])
    tried = [one for one in trials(fitter.problem) if one.hypothesis.effects == ("static-level",)]
    (seen,) = screened(fitter, base, tried).singles
    passed_over = Screening([seen._replace(w=-0.1 * seen.w, others=())], [])
    best = refitted(fitter, base.chi2, passed_over)[0]
    assert best.effects["static-level"]["ratio"] == pytest.approx(0.2, rel=0.2)


def test_a_pair_takes_what_neither_effect_takes_alone():
    """Two directions at right angles hold the difference, a third one a part of each."""
    columns = [column(name, along) for name, along in (("a", (2.0, 0.0)), ("b", (0.0, 1.0)), ("c", (1.0, 1.0)))]
    inner = np.array([one.direction for one in columns])
    left = np.array([6.0, 4.0])
    bounds = (np.full(3, -8.0), np.full(3, 8.0))
    found = best_pairs(columns, inner @ inner.T, inner @ left, bounds, float(left @ left))
    assert {frozenset(one[:2]) for one in found} == {frozenset(pair) for pair in ((0, 1), (0, 2), (1, 2))}
    by_pair = {frozenset(one[:2]): one for one in found}
    assert by_pair[frozenset((0, 1))][2] == pytest.approx([3.0, 4.0])
    assert by_pair[frozenset((0, 1))][3] == pytest.approx(0.0)


def test_a_nuisance_at_its_bound_does_not_take_what_an_effect_would():
    """A difference of 8 along the only nuisance's column, which has gone to its bound of 5."""
    along = np.array([1.0, 0.0, 0.0])
    fit = Fit(NOTHING, np.array([5.0]), np.zeros(0), 89.0, 8.0 * along, along[:, None])
    assert Directions(fit, np.array([5.0])).freed(along)[:3] == pytest.approx(along)
    assert np.linalg.norm(Directions(fit, np.array([6.0])).freed(along)) == pytest.approx(0.5**0.5)
