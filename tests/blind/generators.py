"""The generators of rigs for a blind set: `plant` and `workshop` simulate with the plant, the others share nothing with it."""

from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np


class Effect(Protocol):
    """An effect with a drawn formula and drawn numbers, and a strength that is still to be set."""

    @property
    def name(self) -> str: ...

    def scaled(self, strength: float) -> "Effect":
        """The same effect at another strength: 0 absent, 1 clearly large."""
        ...


class Plan(NamedTuple):
    """All choices for an evidence besides its seed."""

    effects: tuple[Any, ...] = ()
    tolerances: float = 1.0  # how far the true parameters are drawn, in the stated tolerances
    leave_out: tuple[str, ...] = ()  # columns
    smooth: bool = False  # the same friction everywhere on the track
    backbone: str | None = None  # friction law; None: the only one there is


class Generator(Protocol):
    """A source of rigs for `python -m tests.blind make`."""

    library: tuple[str, ...]  # effects that the diagnosis knows
    outside: tuple[str, ...]  # effects that the diagnosis does not know
    usual: str | None  # the usual friction law
    backbones: tuple[str, ...]  # the other friction laws
    strongest: float  # largest strength of an effect
    wide: float  # scale of the tolerances of the widest rigs that still count as rigs without a gap

    def draw(self, random: np.random.Generator, name: str) -> Effect:
        """An effect at full strength."""
        ...

    def formula(self, effect: Any) -> str:
        """An effect's formula and its numbers, for a reader of the key."""
        ...

    def true_numbers(self, plan: Plan, seed: int) -> dict[str, float]:
        """The numbers of the rig that `make` simulates, without its effects, by key of the manifest."""
        ...

    def make(self, folder: Path, plan: Plan, seed: int) -> None:
        """Evidence; the same plan and seed give the same bytes, and without its effects the same rig without them."""
        ...


def generator(name: str) -> Generator:
    """A generator by its name; imported only when it is wanted."""
    if name == "plant":
        from tests.blind.plant_cases import Plant

        return Plant()
    if name == "workshop":
        from tests.blind.workshop import Workshop

        return Workshop()
    from tests.blind.generator import OUTSIDE_2
    from tests.blind.independent_cases import Independent

    return Independent(outside=OUTSIDE_2) if name == "independent-2" else Independent()
