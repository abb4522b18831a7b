"""Axes that never stick: without falling friction, too fast or well damped, and two of the bank that move without need."""

import math
from random import Random
from typing import Any

import numpy as np

from bench.control.answer import EXCITED
from bench.control.drawn import by_factors, rig_table
from bench.control.record import BLOCK_ROWS
from bench.control.rules import CONTROLLER, NONE
from bench.control.run import Subject, judge, wrong_from
from bench.control.scenario import BankScenario, changed, load_bank, scenario_of

_LEARNT_S = 60.0  # time in which the controller may learn that no vibration is needed
_SETTLED_S, _CHECKED_S = 10.0, 20.0  # time of the first load of the spring; duration of the run without vibration
_RAMP_S = 0.1  # duration of each ramp of v_d
_DWELL_S = 0.5  # rest after each move
_KINDS = ("no-drop", "fast", "damped")


def never_axes(seed: int, count: int, duration_s: float) -> list[BankScenario]:
    """Drawn axes of the family `never`, each checked by a run without vibration, and PTFE in moves and oil at the limit."""
    random = Random(seed)  # noqa: S311
    axes: list[BankScenario] = []
    while len(axes) < count:
        kind, in_moves = _KINDS[len(axes) % 3], len(axes) % 4 == 3
        table = _axis(random, "no-drop" if in_moves else kind, in_moves, duration_s)
        name = f"never-{len(axes) + 1:02d}-{'moves' if in_moves else kind}"
        axis = scenario_of("never", f"--seed {seed}: {name}", {"name": name, "duration_s": duration_s, **table})
        if _is_smooth(axis):
            axes.append(axis)
    bank = {scenario.name: scenario for scenario in load_bank()}
    moves = {"rig": {"drive": {"profile": _moves(5e-4, 1.5), "repeat_every_s": 2.0}}}
    oiled = {
        "contact": {"viscous_damping_Ns_per_m": 1500.0},  # 15 N: the force sensor ends at 50 N
        "drive": {"profile": [[0.0, 0.01]]},
        "sensors": {"position_range_m": 0.05 + 0.011 * duration_s},
    }
    return [
        *axes,
        changed(bank["ptfe-stops"], "ptfe-moves-1.5-s", duration_s, moves),
        changed(bank["damped-steel"], "oiled-10-mm-per-s", duration_s, {"rig": oiled}),
    ]


def never_figures(scenario: BankScenario) -> dict[str, float]:
    """Share of the time of motion that the controller vibrates after the first minute; slips and surges once loaded."""
    judged = judge(scenario, Subject(CONTROLLER))
    rows, times_s = judged.coarse.rows, np.arange(len(judged.coarse.rows)) * judged.coarse.step_s
    drive_mps, v_a_mps = (rows[:, BLOCK_ROWS.index(name)] for name in ("drive_mps", "v_a_mps"))
    moves = (np.abs(drive_mps) > 0.02 * scenario.slowest_mps) & (times_s > min(_LEARNT_S, 0.5 * scenario.duration_s))
    excited = v_a_mps[moves] > EXCITED * np.abs(drive_mps[moves])
    return {
        "excited_share": float(excited.mean()),
        "wrong": int(wrong_from(judged.events, _SETTLED_S).sum()),
    }


def _is_smooth(axis: BankScenario) -> bool:
    short = axis._replace(table=axis.table | {"duration_s": _CHECKED_S})
    return not wrong_from(judge(short, Subject(NONE)).events, _SETTLED_S).any()


def _axis(random: Random, kind: str, in_moves: bool, duration_s: float) -> dict[str, Any]:
    """A scenario as in a file of the bank, which may still stick and slip; the spring is loaded within 4 s."""
    while True:
        k_d, mass_kg = 1e6 * by_factors(random, 0.0126, 50.0), by_factors(random, 0.5, 200.0)
        v_d, drop = by_factors(random, 1e-4, 1.5e-3), 0.0 if kind == "no-drop" else random.uniform(0.02, 0.2)
        static_N = float(f"{mass_kg * random.uniform(2.0, 5.0):.3g}")
        damping_ratio = random.uniform(0.3, 1.0) if kind == "damped" else random.uniform(0.005, 0.05)
        fastest = drop * static_N / math.sqrt(k_d * mass_kg) / v_d  # largest v_s of a slip, over v_d
        if static_N / (k_d * v_d) < 4.0 and (kind != "fast" or fastest < 0.5):
            break
    rig = rig_table(mass_kg, static_N, drop)
    drive = {
        "stiffness_N_per_m": k_d,
        "damping_Ns_per_m": 2.0 * damping_ratio * math.sqrt(k_d * mass_kg),
        "profile": [[0.0, v_d]],
    }
    if in_moves:
        move_s = round(random.uniform(1.5, 6.0), 1)
        out = _moves(v_d, move_s)
        back = [[move_s + _DWELL_S + at_s, -v_mps] for at_s, v_mps in out[1:]]
        drive |= {"profile": [*out, *back], "repeat_every_s": 2.0 * (move_s + _DWELL_S)}
    else:
        rig["sensors"] |= {"position_range_m": 0.05 + 1.1 * v_d * duration_s, "position_linearity": 0.0}
    words = f"{kind}: {k_d * 1e-6:.3g} N/um, {mass_kg:.3g} kg, {v_d * 1e3:.3g} mm/s, F_s {static_N:.3g} N"
    return {"description": words, "bank": {"expect": "not-needed"}, "rig": rig | {"drive": drive}}


def _moves(v_d: float, move_s: float) -> list[list[float]]:
    """A move of this duration, and a dwell."""
    return [[0.0, 0.0], [_RAMP_S, v_d], [move_s - _RAMP_S, v_d], [move_s, 0.0], [move_s + _DWELL_S, 0.0]]
