"""Cases of the generator that shares nothing with plant and diagnosis."""

from pathlib import Path

import numpy as np

from tests.blind.generator import LIBRARY, OUTSIDE, Case, Effect, draw_effect, make, numbers
from tests.blind.generator.runs import PROTOCOL
from tests.blind.generator.runs import Plan as RunPlan
from tests.blind.generators import Plan


class Independent:
    """Rigs with another integrator, other formulas and, in a third of the cases, another friction law.

    Args:
        runs: the protocol of every evidence.
        outside: the effects that have no name in the library.

    """

    library = tuple(LIBRARY)
    usual = "lugre"
    backbones = ("multi-element", "lorentzian", "stretched")
    strongest = 1.5
    wide = 1.1  # draws are cut at three tolerances before they are scaled, and a gap begins at 3.3 tolerances

    def __init__(self, runs: tuple[RunPlan, ...] = PROTOCOL, outside: tuple[str, ...] = OUTSIDE) -> None:
        self._runs = runs
        self.outside = outside

    def draw(self, random: np.random.Generator, name: str) -> Effect:
        return draw_effect(random, name)

    def formula(self, effect: Effect) -> str:
        drawn = {name: float(value) for name, value in effect.numbers.items()}
        return f"{effect.formula.name} {drawn}"

    def true_numbers(self, plan: Plan, seed: int) -> dict[str, float]:
        return numbers(_case(plan), seed)

    def make(self, folder: Path, plan: Plan, seed: int) -> None:
        make(folder, _case(plan), seed, self._runs)


def _case(plan: Plan) -> Case:
    return Case(
        effects=plan.effects,
        backbone=plan.backbone,
        tolerances=plan.tolerances,
        leave_out=plan.leave_out,
        roughness=0.0 if plan.smooth else 1.0,
    )
