"""A small set with shorter runs and kept sizes, as sizing would take minutes of `make test`.

`python -m tests.blind.small_set` sizes its effects again and writes `small_set.toml`.
"""

import sys
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import joblib

from bench.blind.sealing import Answer
from tests.blind.generator.runs import Plan as RunPlan
from tests.blind.generators import Generator, Plan
from tests.blind.independent_cases import Independent
from tests.blind.making import Sized, made
from tests.blind.sizes import Sizes, read_sizes, write_sizes
from tests.blind.strata import Drawn, draw

CASES, SEED = 28, 7003
RUNS = (
    RunPlan(drive=((0.0, 2e-3), (2.5, -2e-3)), duration_s=5.0),
    RunPlan(drive=((0.0, 0.6e-3),), vibration=((1.5, 3000.0), (2.7, 1200.0), (3.9, 4500.0)), duration_s=5.0),
    RunPlan(drive=((0.0, 1.5e-3),), vibration=((2.5, 2500.0),), holdout=True, duration_s=4.0),
)


class Part(NamedTuple):
    """Some of the cases."""

    seeds: frozenset[int]
    visible: int  # single effects of two detection limits or more
    without_gap: int
    jobs: int  # two separate processes cost 30 s of CPU more than 1, which is this process; test_many.py has two


SIZES = Path(__file__).with_suffix(".toml")
# A rig without a gap under another friction law, and a visible effect of the contact; each takes half a minute of CPU. What lies
# outside the library: test_vibrations.
FEW = Part(frozenset({1704659489, 214160429}), visible=1, without_gap=1, jobs=1)
ALL = Part(frozenset(read_sizes(SIZES)) | {1704659489, 332728213, 496335432}, visible=7, without_gap=3, jobs=2)


def known(
    _source: Generator, case: Drawn, _plan: Plan, _scratch: Path, _known: Sizes
) -> tuple[list[Sized], list[list[Any]]]:
    """In place of `making.sized`: the sizes of `small_set.toml`, without cells."""
    sizes = read_sizes(SIZES)[case.seed]
    return [Sized(effect.scaled(sizes[effect.name][0]), *sizes[effect.name]) for effect in case.effects], []


def _write_sizes() -> None:
    cases = {str(number): case for number, case in enumerate(draw(Independent(RUNS), CASES, SEED)) if case.effects}
    answers: list[Answer] = []
    with tempfile.TemporaryDirectory() as folder:
        for _, answer in made(Independent(RUNS), cases, Path(folder), joblib.cpu_count(), {}):
            answers.append(answer)
            print(
                f"{len(answers)} of {len(cases)}",
                [effect["detectability"] for effect in answer["effects"]],
                file=sys.stderr,
            )
    write_sizes(SIZES, answers)


if __name__ == "__main__":
    _write_sizes()
