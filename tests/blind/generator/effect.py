"""An effect: the name of a mechanism, one formula for it, the numbers of this formula, and one strength."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from tests.blind.generator.runs import Tracks

Numbers = Mapping[str, float]
Signals = dict[str, np.ndarray]  # standard column -> (samples,)


@dataclass(frozen=True)
class Formula:
    """One way in which a mechanism acts. `draw` gives its numbers; each hook gets (object to change, strength, numbers).

    rig      params (1,) PARAMS, in place
    surface  positions [m], friction level along the track, in place
    run      Tracks of one run, in place
    sense    true signals of one run, before the sensor chain, in place
    """

    effect: str
    name: str
    draw: Callable[[np.random.Generator], dict[str, float]]
    rig: Callable[[np.ndarray, float, Numbers], None] | None = None
    surface: Callable[[np.ndarray, np.ndarray, float, Numbers], None] | None = None
    run: Callable[[Tracks, float, Numbers], None] | None = None
    sense: Callable[[Signals, float, Numbers], None] | None = None

    def __reduce__(self):
        return _find, (self.effect, self.name)  # by name: lambdas do not pickle, and cases travel to workers


@dataclass(frozen=True)
class Effect:
    """A drawn effect. Strength 1 is clearly large for its mechanism; 0 is a rig without the effect."""

    formula: Formula
    numbers: Numbers = field(hash=False)
    strength: float = 1.0

    def __post_init__(self) -> None:
        if not self.strength >= 0.0:
            raise ValueError(f"strength = {self.strength}: must be 0 or above")

    @property
    def name(self) -> str:
        return self.formula.effect

    def scaled(self, strength: float) -> "Effect":
        """The same effect at another strength."""
        return replace(self, strength=strength)


def _find(effect: str, name: str) -> Formula:
    from tests.blind.generator.library import formulas_of  # the library is made of formulas: it imports this file

    return next(formula for formula in formulas_of(effect) if formula.name == name)


def scales(*scaled: str, keeps: tuple[str, ...] = ()) -> Callable[[np.ndarray, float, Numbers], None]:
    """A rig hook that sets these fields of PARAMS to strength times their number, and `keeps` to their number."""

    def rig(p: np.ndarray, s: float, n: Numbers) -> None:
        for name in keeps:
            p[name] = n[name]
        for name in scaled:
            p[name] = s * n[name]

    return rig


def either(random: np.random.Generator) -> float:
    """A sign."""
    return float(random.choice((-1.0, 1.0)))


def noise_seed(random: np.random.Generator) -> float:
    """A seed for numbers that a formula draws per run; a float, as all numbers of an effect are floats."""
    return float(random.integers(2**31))


def noise_of(numbers: Numbers, run: int) -> np.random.Generator:
    return np.random.default_rng([int(numbers["seed"]), run])
