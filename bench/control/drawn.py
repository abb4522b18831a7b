"""Axes drawn at random: unseen axes judge a controller better than the bank that it was developed with.

Drive stiffness 0.013 to 50 N/um, mass 0.5 to 200 kg and feed 0.1 to 1.5 mm/s, each log-uniform. Only axes with stick-slip
without control are kept. Every second axis moves back and forth; 25 % have late commands, another 15 % long blocks. Every second
pair of axes gives the controller no k_d, and its names show it.
"""

import math
from random import Random
from typing import Any

from bench.control.scenario import BankScenario, scenario_of

AXES = 60
_GIVE_M = 0.22e-6  # elastic deflection of the contact at breakaway, F_s / k_t, as for the paper's steel
_RAMP_S = 0.1  # duration of each ramp of v_d at the ends of a stroke


def drawn_axes(seed: int, count: int = AXES) -> list[BankScenario]:
    """Scenarios of the family `drawn`; the same seed draws the same axes."""
    random = Random(seed)  # noqa: S311
    axes: list[BankScenario] = []
    while len(axes) < count:
        table = _axis(random, back_and_forth=len(axes) % 2 == 1)
        if table is not None:
            gives_k_d = len(axes) % 4 < 2
            name = f"axis-{len(axes) + 1:02d}{'' if gives_k_d else '-without-k_d'}"
            bank = {"told": {"drive_stiffness_given": gives_k_d}}
            axes.append(scenario_of("drawn", f"--drawn {seed}: {name}", {"name": name, "bank": bank, **table}))
    return axes


def by_factors(random: Random, low: float, high: float) -> float:
    """Log-uniform number, rounded to three digits."""
    return float(f"{math.exp(random.uniform(math.log(low), math.log(high))):.3g}")


def _axis(random: Random, back_and_forth: bool) -> dict[str, Any] | None:
    """A scenario as in a file of the bank; None for an axis that does not stick and slip, or whose run takes too long."""
    k_d, mass_kg = 1e6 * by_factors(random, 0.0126, 50.0), by_factors(random, 0.5, 200.0)
    v_d, drop = by_factors(random, 1e-4, 1.5e-3), random.uniform(0.1, 0.3)
    static_N = float(f"{mass_kg * random.uniform(2.0, 5.0):.3g}")
    stick_s, load_s = 2.0 * drop * static_N / (k_d * v_d), 2.0 * static_N / (k_d * v_d)
    fastest = drop * static_N / math.sqrt(k_d * mass_kg) / v_d  # largest v_s of a slip, over v_d
    if fastest < 1.5 or not 1.5e-3 <= stick_s <= 8.0:
        return None
    words = f"{k_d * 1e-6:.3g} N/um, {mass_kg:.3g} kg, {v_d * 1e3:.3g} mm/s, F_s {static_N:.3g} N"
    drive = {"stiffness_N_per_m": k_d, "damping_Ns_per_m": 2.0 * random.uniform(0.005, 0.05) * math.sqrt(k_d * mass_kg)}
    if back_and_forth:
        way_s = round(max(2.0, 1.2 * (load_s + stick_s)), 1)
        duration_s = round(4.0 * way_s, 1)
        drive |= _there_and_back(v_d, way_s)
        words += ", back and forth"
    else:
        duration_s = round(max(6.0, min(4.0 * stick_s + load_s, 60.0)), 1)
        drive |= {"profile": [[0.0, v_d]]}
    if duration_s > 120.0:
        return None
    rig = rig_table(mass_kg, static_N, drop) | {"drive": drive}
    return {"description": words + _loop(random, rig), "duration_s": duration_s, "rig": rig}


def _there_and_back(v_d: float, way_s: float) -> dict[str, Any]:
    turns = [(0.0, 0.0), (_RAMP_S, v_d), (way_s - _RAMP_S, v_d), (way_s, 0.0)]
    back = [(way_s + at_s, -v_mps) for at_s, v_mps in turns[1:]]
    return {"profile": [list(point) for point in (*turns, *back)], "repeat_every_s": 2.0 * way_s}


def rig_table(mass_kg: float, static_N: float, drop: float) -> dict[str, Any]:
    """A rig without its drive; `drop` is the share by which friction falls."""
    stiffness = static_N / _GIVE_M
    return {
        "slide": {"mass_kg": mass_kg},
        "contact": {
            "stiffness_N_per_m": stiffness,
            "damping_Ns_per_m": 2.0 * math.sqrt(stiffness * mass_kg),
            "coulomb_force_N": static_N * (1.0 - drop),
            "static_force_N": static_N,
        },
        "piezo": {"amplitude_max_m": 1e-6, "amplitude_slew_m_per_s": 1e-5},
        "sensors": {
            "force_range_N": 3.5 * static_N,
            "force_lowest_N": -3.5 * static_N,
            "force_noise_N": 0.002 * static_N,
            "force_resolution_N": 7.0 * static_N / 2**16,
            "position_lowest_m": -0.05,
            "position_range_m": 0.12,
        },
    }


def _loop(random: Random, rig: dict[str, Any]) -> str:
    """Give some rigs late commands or long blocks; return this as a text."""
    share = random.random()
    if share < 0.25:
        delay_s = random.choice([0.005, 0.01, 0.02])
        rig["loop"] = {"delay_s": delay_s}
        rig["piezo"]["command_timeout_s"] = 0.3
        return f", commands {delay_s * 1e3:g} ms late"
    if share < 0.4:
        block_s = random.choice([0.002, 0.005])
        rig["solver"] = {"block_s": block_s, "samples_per_block": round(block_s * 20_000)}
        return f", blocks of {block_s * 1e3:g} ms"
    return ""
