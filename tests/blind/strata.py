"""The cases of a set: kinds of cases in their shares, effects in turn, all drawn from one seed."""

from typing import NamedTuple

import numpy as np

from tests.blind.generators import Effect, Generator
from tests.blind.real_logs import real_cases

SHARES = {
    "no-gap": 0.15,
    "one-effect": 0.50,
    "two-effects": 0.12,
    "outside": 0.12,
    "indistinguishable": 0.08,
    "real-log": 0.03,
}
REAL = "real-log"
FEWEST = len(SHARES)
TARGETS = (2.0, 4.0, 8.0)  # detection limits
OTHER_BACKBONES = 1 / 3
ACCELERATIONS = ("mass_accel_mps2", "base_accel_mps2")
# the drive position stays: without it a run whose drive velocity changes cannot be read
BUT_FORCE_AND_DRIVE = (*ACCELERATIONS, "mass_position_m")


class Unclear(NamedTuple):
    """Effects that the remaining channels cannot separate, or only barely."""

    group: tuple[str, ...]
    leave_out: tuple[str, ...]


UNCLEAR = (
    # where the force alone is measured, 1 ms of lag looks like 12 N s/m of damping
    Unclear(("force-sensor-delay", "force-sensor-lag", "drive-damping"), BUT_FORCE_AND_DRIVE),
    # force, stiffness and friction all scale alike
    Unclear(("force-sensor-gain", "coulomb-level", "static-level", "drive-stiffness"), BUT_FORCE_AND_DRIVE),
    # the delivered vibration is not measured; the runs show only that it is weaker
    Unclear(("piezo-roll-off", "piezo-resonance", "piezo-sag"), ACCELERATIONS),
)


class Drawn(NamedTuple):
    """A case before its effects are sized."""

    stratum: str
    seed: int
    effects: tuple[Effect, ...] = ()
    targets: tuple[float, ...] = ()  # detection limits, of each effect
    group: tuple[str, ...] = ()  # acceptable names
    tolerances: float = 1.0
    leave_out: tuple[str, ...] = ()
    backbone: str | None = None
    number: int = 0  # of the fault, in a real log


def counts(cases: int, has_outside: bool, real: int) -> dict[str, int]:
    """The number of cases of each kind: one at least; the remainder of rounding goes to the single effects.

    Args:
        cases: number of cases of all kinds together.
        has_outside: whether the generator has effects outside the library.
        real: number of faults in measured logs.

    """
    numbers = {name: max(1, round(share * cases)) for name, share in SHARES.items()}
    numbers["outside"] *= has_outside
    numbers[REAL] = min(numbers[REAL], real)
    numbers["one-effect"] += cases - sum(numbers.values())
    return numbers


def _real_faults() -> int:
    """The number of faults in measured logs; 0 without the logs."""
    try:
        return len(list(real_cases(np.random.default_rng(0))))
    except FileNotFoundError:
        return 0


def draw(generator: Generator, cases: int, seed: int) -> list[Drawn]:
    """Draw all cases, ordered by kind."""
    library, outside = generator.library, generator.outside
    source = np.random.default_rng([seed, 0])
    turns = {names: source.permutation(names).tolist() for names in (library, outside) if names}
    drawn_cases: list[Drawn] = []
    faults = source.permutation(_real_faults()).tolist()
    for kind, (stratum, count) in enumerate(counts(cases, bool(outside), len(faults)).items(), 1):
        for number in range(count):
            random = np.random.default_rng([seed, kind, number])
            case = Drawn(stratum, int(random.integers(1 << 31)), backbone=generator.usual)
            names: list[str] = []
            if stratum == REAL:
                drawn_cases.append(case._replace(number=faults[number], backbone=None))
                continue
            if stratum == "no-gap":
                case = case._replace(tolerances=generator.wide if number % 2 else 1.0)
            elif stratum == "one-effect":
                names = [turns[library][number % len(library)]]
            elif stratum == "two-effects":
                names = [str(name) for name in random.choice(library, 2, replace=False)]
            elif stratum == "outside":
                names = [turns[outside][number % len(outside)]]
            else:
                unclear = UNCLEAR[number % len(UNCLEAR)]
                names = [str(random.choice(unclear.group))]
                case = case._replace(group=unclear.group, leave_out=unclear.leave_out)
            if generator.backbones and random.random() < OTHER_BACKBONES:
                case = case._replace(backbone=str(random.choice(generator.backbones)))
            effects = tuple(generator.draw(random, name) for name in names)
            targets = tuple(float(random.choice(TARGETS)) for _ in names)
            group = case.group or (tuple(names) if len(names) == 1 and stratum != "outside" else ())
            drawn_cases.append(case._replace(effects=effects, targets=targets, group=group))
    return drawn_cases
