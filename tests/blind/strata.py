"""The cases of a set: kinds of cases in their shares, effects in turn, all drawn from one seed."""

from typing import NamedTuple

import numpy as np

from tests.blind.generators import Effect, Generator

SHARES = {"no-gap": 0.20, "one-effect": 0.40, "two-effects": 0.15, "outside": 0.15, "wrong-number": 0.10}
FEWEST = len(SHARES)
_MORE_OUTSIDE = 1.5  # two of the three generators of a large set have effects outside the library
TARGETS = (2.0, 4.0, 8.0)  # detection limits
OTHER_BACKBONES = 1 / 3


class Drawn(NamedTuple):
    """A case before its effects are sized."""

    stratum: str
    seed: int
    effects: tuple[Effect, ...] = ()
    targets: tuple[float, ...] = ()  # detection limits, of each effect
    tolerances: float = 1.0
    backbone: str | None = None


def counts(cases: int, has_outside: bool) -> dict[str, int]:
    """The number of cases of each kind: one at least; the remainder of rounding goes to the single effects.

    Three equal sets, one of them of a generator without effects outside the library, have the shares of `SHARES` together.

    Args:
        cases: number of cases of all kinds together.
        has_outside: whether the generator has effects outside the library.

    """
    outside = max(1, round(_MORE_OUTSIDE * SHARES["outside"] * cases)) if has_outside else 0
    others = (cases - outside) / (1.0 - SHARES["outside"])
    numbers = {name: max(1, round(share * others)) for name, share in SHARES.items()} | {"outside": outside}
    numbers["one-effect"] += cases - sum(numbers.values())
    return numbers


def draw(generator: Generator, cases: int, seed: int) -> list[Drawn]:
    """Draw all cases, ordered by kind; more cases are the same cases and others."""
    library, outside = generator.library, generator.outside
    source = np.random.default_rng([seed, 0])
    turns = {names: source.permutation(names).tolist() for names in (library, outside) if names}
    drawn_cases: list[Drawn] = []
    for kind, (stratum, count) in enumerate(counts(cases, bool(outside)).items(), 1):
        for number in range(count):
            random = np.random.default_rng([seed, kind, number])
            case = Drawn(stratum, int(random.integers(1 << 31)), backbone=generator.usual)
            if stratum == "wrong-number":  # of the usual law, as under another its numbers mean something else
                drawn_cases.append(case)
                continue
            names: list[str] = []
            if stratum == "no-gap":
                case = case._replace(tolerances=generator.wide if number % 2 else 1.0)
            elif stratum == "one-effect":
                names = [turns[library][number % len(library)]]
            elif stratum == "two-effects":
                names = [str(name) for name in random.choice(library, 2, replace=False)]
            else:
                names = [turns[outside][number % len(outside)]]
            if generator.backbones and random.random() < OTHER_BACKBONES:
                case = case._replace(backbone=str(random.choice(generator.backbones)))
            effects = tuple(generator.draw(random, name) for name in names)
            targets = tuple(float(random.choice(TARGETS)) for _ in names)
            drawn_cases.append(case._replace(effects=effects, targets=targets))
    return drawn_cases
