"""The 26 effects that have a name: the formulas of each mechanism, from the literature, and how their numbers are drawn."""

import numpy as np

from tests.blind.generator import library_friction, library_machine, library_sensors
from tests.blind.generator.effect import Effect, Formula
from tests.blind.generator.outside import OUTSIDE_FORMULAS
from tests.blind.generator.outside_2 import OUTSIDE_2_FORMULAS

_FORMULAS: dict[str, list[Formula]] = {}
for _formula in (*library_friction.FORMULAS, *library_machine.FORMULAS, *library_sensors.FORMULAS):
    _FORMULAS.setdefault(_formula.effect, []).append(_formula)
LIBRARY = tuple(_FORMULAS)


def formulas_of(name: str) -> list[Formula]:
    """Every formula of an effect, in the library or outside it."""
    formulas = _FORMULAS.get(name) or [f for f in (*OUTSIDE_FORMULAS, *OUTSIDE_2_FORMULAS) if f.effect == name]
    if not formulas:
        raise KeyError(f"{name}: no such effect; see LIBRARY, OUTSIDE and OUTSIDE_2")
    return formulas


def draw_effect(random: np.random.Generator, name: str) -> Effect:
    """An effect of this name, in the library or outside it, at strength 1, with a drawn formula and drawn numbers."""
    formulas = formulas_of(name)
    formula = formulas[int(random.integers(len(formulas)))]
    return Effect(formula, formula.draw(random))
