"""Cost of the effects: the disturbed kernel compared with the nominal one, and each effect in addition, in one run."""

import time
from statistics import median
from typing import Any, NamedTuple

import numpy as np

from bridge.wire.channels import CHANNELS
from plant.config import RigConfig
from plant.effects.library import EFFECTS
from plant.records import TRUTH, build
from plant.simulate import run_blocks
from tests.speed import case as paper

DURATION_S = 0.5
REPETITIONS = 15
NOTE = f"""One core, {paper.RIG.solver.step_s * 1e6:g} us steps, {DURATION_S:g} s of the paper's drive with 2 kHz.
Medians of {REPETITIONS} runs in turns. An effect that only changes a number of the rig runs in the nominal kernel
and costs nothing."""


class Row(NamedTuple):
    name: str
    config: RigConfig
    disturbed: bool  # whether it runs in the kernel that has the effects
    walls_s: list[float]


def _row(name: str, effects: dict[str, Any] | None = None, disturbed: bool = False, **contact: Any) -> Row:
    table = {"contact": {"pair": paper.PAIR, **contact}, "effects": effects or {}}
    config = RigConfig.model_validate(table)
    return Row(name, config, disturbed or bool(build(config)[0][0].disturbed), [])


def _wall_s(row: Row) -> float:
    params, state = build(row.config)
    params[0].disturbed = row.disturbed
    solver = row.config.solver
    blocks = round(DURATION_S / solver.block_s)
    each = np.ones(blocks)
    analogue, truth = (np.empty((len(rows), blocks * solver.samples_per_block)) for rows in (CHANNELS, TRUTH))
    begin = time.perf_counter()
    run_blocks(params, state, each * paper.DRIVE_VELOCITY_MPS, each * 2000.0, each * 2e-8, analogue, truth)
    return time.perf_counter() - begin


def rows() -> list[Row]:
    """The nominal rig, the same in the other kernel, then everything that runs there, form by form."""
    effects = [
        _row(f"{name}, {form}" if form else name, {name: {"form": form}})
        for name, effect in EFFECTS.items()
        for form in effect.forms
    ]
    contacts = [_row("rough surface", roughness_ratio=0.05), _row("elasto-plastic", backbone="elasto-plastic")]
    running = [row for row in effects + contacts if row.disturbed]
    return [_row("nominal"), _row("nothing switched on", disturbed=True), *running]


def bench(quick: bool = False) -> bool:
    """Print the table, except in a quick run; True, as there is no limit."""
    if quick:
        return True
    table = rows()
    for row in table[:2]:
        _wall_s(row)  # the first call of each kernel may have to compile
    for _ in range(REPETITIONS):
        for row in table:
            row.walls_s.append(_wall_s(row))
    nominal_s, idle_s = median(table[0].walls_s), median(table[1].walls_s)
    print(f"\n{NOTE}")
    print(f"{'effect':<40} {'sim s / s':>10} {'nominal':>10} {'nothing on':>11}")
    for row in table:
        wall_s = median(row.walls_s)
        print(f"{row.name:<40} {DURATION_S / wall_s:>10.3g} {wall_s / nominal_s:>8.2f} x {wall_s / idle_s:>9.2f} x")
    return True
