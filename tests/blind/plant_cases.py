"""Cases of the plant's own generator: the formulas are those that the diagnosis tries."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from diagnosis.evidence.manifest import rig_numbers
from diagnosis.synthetic import folder as synthetic
from diagnosis.synthetic.folder import Case, make_evidence, paper_rig
from tests.blind.generators import Plan
from tests.blind.plant_sizes import EFFECT_SIZES, Sizes, possible
from tests.made_protocols import case_of


class PlantEffect(NamedTuple):
    """An effect as in a rig file, with the size that counts as strength 1."""

    name: str
    size: str  # name of the parameter that the strength changes
    large: float  # value of this parameter at strength 1
    inverse: bool  # whether a smaller value is a larger effect, as with a corner frequency
    others: dict[str, float | str]
    strength: float = 1.0

    def scaled(self, strength: float) -> "PlantEffect":
        return self._replace(strength=strength)

    @property
    def numbers(self) -> dict[str, float | str]:
        """The table of a rig file."""
        value = self.large / self.strength if self.inverse else self.large * self.strength
        return {self.size: value, **self.others}


class Plant:
    """Rigs of the plant.

    Args:
        protocol: of every evidence, in `tests/made_protocols.py`.

    """

    library = tuple(possible("spring", vibrated=True))
    outside = ()
    usual = None
    backbones = ()
    strongest = 1.0  # beyond, some rigs are impossible: their static friction is below the Coulomb friction
    wide = 1.5  # no number is drawn beyond three tolerances

    def __init__(self, protocol: str = "ladder") -> None:
        self._protocol = protocol

    def draw(self, random: np.random.Generator, name: str) -> PlantEffect:
        forms = EFFECT_SIZES[name]
        return drawn(random, name, forms[random.integers(len(forms))])

    def formula(self, effect: PlantEffect) -> str:
        return str(effect.numbers)

    def true_numbers(self, plan: Plan, seed: int) -> dict[str, float]:
        case, described = self._case(plan), paper_rig()
        of_rig, _ = np.random.SeedSequence(seed).spawn(2)
        table = synthetic._rig_table(described, case.drive, case.tolerances)
        return rig_numbers(synthetic._draw_rig(np.random.default_rng(of_rig), described, table, case).config)

    def make(self, folder: Path, plan: Plan, seed: int) -> None:
        make_evidence(folder, self._case(plan), seed)

    def _case(self, plan: Plan) -> Case:
        effects = {effect.name: effect.numbers for effect in plan.effects}
        return case_of(self._protocol, effects, leave_out=plan.leave_out, spread=plan.tolerances, rough=not plan.smooth)


def drawn(random: np.random.Generator, name: str, sizes: Sizes) -> PlantEffect:
    """One form of an effect, with drawn sign and drawn parameters."""
    others: dict[str, float | str] = {"form": sizes.form} if sizes.form else {}
    sign = float(random.choice(sizes.signs))
    others |= {key: low * (high / low) ** random.random() for key, (low, high) in sizes.log.items()}
    others |= {key: random.uniform(low, high) for key, (low, high) in sizes.even.items()}
    return PlantEffect(name, sizes.parameter, sign * sizes.large, sizes.large < sizes.barely, others)
