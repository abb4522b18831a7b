"""A small set with shorter runs, whose sizes are known: sizing takes minutes that `make test` has better use for.

`python -m tests.blind.small_set` sizes its effects anew and writes `small_set.toml`.
"""

import sys
import tempfile
import tomllib
from pathlib import Path
from typing import Any
from unittest.mock import patch

from tests.blind import strata
from tests.blind.generator.runs import Plan as RunPlan
from tests.blind.generators import Generator, Plan
from tests.blind.independent_cases import Independent
from tests.blind.making import Seen, Sized, sized
from tests.blind.strata import Drawn, draw

CASES, SEED = 18, 7003
RUNS = (
    RunPlan(drive=((0.0, 2e-3), (2.5, -2e-3)), duration_s=5.0),
    RunPlan(drive=((0.0, 0.6e-3),), vibration=((1.5, 3000.0), (2.7, 1200.0), (3.9, 4500.0)), duration_s=5.0),
    RunPlan(drive=((0.0, 1.5e-3),), vibration=((2.5, 2500.0),), holdout=True, duration_s=4.0),
)
SIZES = Path(__file__).with_suffix(".toml")


def known(_source: Generator, case: Drawn, _plan: Plan, _scratch: Path) -> tuple[list[Sized], list[list[Any]]]:
    """In place of `making.sized`: the sizes of `small_set.toml`, without cells."""
    table = tomllib.loads(SIZES.read_text(encoding="utf-8"))[str(case.seed)]
    return [
        Sized(effect.scaled(strength), strength, Seen(limits, []))
        for effect in case.effects
        for strength, limits in [table[effect.name]]
    ], []


def _write_sizes() -> None:
    source = Independent(RUNS)
    lines = [
        "# seed of a case, and of each of its effects the strength and the detection limits that it is worth there"
    ]
    with patch.object(strata, "_real_faults", lambda: 0):
        cases = draw(source, CASES, SEED)
    for case in cases:
        if not case.effects:
            continue
        with tempfile.TemporaryDirectory() as scratch:
            sizes, _ = sized(
                source, case, Plan((), case.tolerances, case.leave_out, backbone=case.backbone), Path(scratch)
            )
        lines += ["", f"[{case.seed}]"]
        lines += [f"{one.effect.name} = [{one.strength:.4f}, {one.seen.detectability:.2f}]" for one in sizes]
        print("\n".join(lines[-len(sizes) - 1 :]), file=sys.stderr, flush=True)
    SIZES.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    _write_sizes()
