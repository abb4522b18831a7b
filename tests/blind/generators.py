"""Where the rigs of a blind set come from: a generator that knows nothing of the plant, or the plant itself."""

from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np


class Effect(Protocol):
    """An effect with everything drawn but how strong it is."""

    @property
    def name(self) -> str: ...

    def scaled(self, strength: float) -> "Effect":
        """The same at another strength: 0 absent, 1 clearly large."""
        ...


class Plan(NamedTuple):
    """What to make, besides the seed."""

    effects: tuple[Any, ...] = ()
    tolerances: float = 1.0  # how far the true parameters are drawn, in the stated tolerances
    leave_out: tuple[str, ...] = ()  # columns
    smooth: bool = False  # the same friction everywhere on the track
    backbone: str | None = None  # friction law; None: the only one there is


class Generator(Protocol):
    """What `python -m tests.blind make` needs of a generator."""

    library: tuple[str, ...]  # effects that the diagnosis knows
    outside: tuple[str, ...]  # effects that it does not know
    usual: str | None  # friction law
    backbones: tuple[str, ...]  # others
    strongest: float  # strength
    wide: float  # tolerances from which a rig without a gap may be drawn at most

    def draw(self, random: np.random.Generator, name: str) -> Effect:
        """An effect at full strength."""
        ...

    def formula(self, effect: Any) -> str:
        """An effect's formula and its numbers, for a person who reads the key."""
        ...

    def make(self, folder: Path, plan: Plan, seed: int) -> None:
        """Evidence; the same plan and seed give the same bytes, and without its effects the same rig without them."""
        ...


def generator(name: str) -> Generator:
    """A generator by its name; imported only when it is wanted."""
    if name == "plant":
        from tests.blind.plant_cases import Plant

        return Plant()
    from tests.blind.independent_cases import Independent

    return Independent()
