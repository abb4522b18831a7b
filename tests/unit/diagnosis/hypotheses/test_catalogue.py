"""Every effect of the plant has a row in the diagnosis, and every row an effect: nothing is added in one of them alone."""

import pytest

from diagnosis.hypotheses.catalogue import CATALOGUE
from diagnosis.hypotheses.hypothesis import Sizes
from diagnosis.pictures.choice import SHOWN, X
from plant.effects.library import EFFECTS

NO_PREDICTION_FOLLOWS = "random"
SIZES = Sizes(9.0, 1e4, 1e-3, 100.0, 0.03, 0.02, 10.0, 4000.0)
FORMS = [(name, form) for name, row in CATALOGUE.items() for form in row.forms]


def test_every_effect_has_a_row_and_every_row_an_effect():
    assert CATALOGUE.keys() == EFFECTS.keys()


@pytest.mark.parametrize("name", EFFECTS)
def test_every_form_is_tried_but_random_ones(name):
    assert CATALOGUE[name].forms.keys() == EFFECTS[name].forms.keys() - {NO_PREDICTION_FOLLOWS}


@pytest.mark.parametrize(("name", "form"), FORMS)
def test_each_scale_belongs_to_a_parameter_of_the_form(name, form):
    scales = CATALOGUE[name].forms[form].scale(SIZES)
    assert scales.keys() <= {row.name for row in EFFECTS[name].forms[form].parameters}
    assert all(scale.scale > 0.0 and scale.prior > 0.0 for scale in scales.values())


@pytest.mark.parametrize("name", EFFECTS)
def test_a_row_names_existing_relations_and_effects(name):
    row = CATALOGUE[name]
    assert row.words
    assert row.shown_by
    for residual, variable in row.shown_by:
        assert residual in SHOWN
        assert variable in X
    assert row.check_against.keys() <= EFFECTS.keys() - {name}
    for other in row.check_against:
        assert name not in CATALOGUE[other].check_against
