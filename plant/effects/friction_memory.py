"""Friction with a memory: the contact ages at rest, and the Stribeck curve lags behind the velocity.

Sources: ageing log: Dieterich 1972, rate and state; power: Rabinowicz 1958; settling: Kato, Sato & Matsubayashi 1974, with their
exponent 1; lag over time and as a dead time: Hess & Soom 1990; over a distance: Rabinowicz 1958, of a share: Ruina 1983, two
state variables; log and power ageing as in Armstrong-Helouvry, Dupont & Canudas de Wit 1994.
"""

import math
from typing import Any, Final

from bridge.kernel import kernel
from bridge.layouts import PlantMemory, PlantParams
from plant.effects.row import Effect, Formula, Parameter, ratio

LONGEST_LAG_S: Final = 0.025  # longest dead time of friction behind the velocity
LAG_CELL_S: Final = 2e-5  # time step of the speed's delay line: 11 cells in a period at 4.5 kHz
_LAG_LINE = round(LONGEST_LAG_S / LAG_CELL_S) + 2  # the cells of the longest lag, the previous and the present cell


@kernel
def ageing_N(p: PlantParams, age_s: float) -> float:
    """Excess of the static friction over F_s [N] at this age of the contact; below 0 before the age `rested_s`."""
    if p.age_exponent > 0.0:
        return p.age_growth_N * age_s**p.age_exponent - p.age_rested_N
    if p.age_settling_s > 0.0:
        return p.age_growth_N * (1.0 - math.exp(-age_s / p.age_settling_s)) - p.age_rested_N
    return p.age_growth_N * math.log(1.0 + age_s / p.age_scale_s) - p.age_rested_N


@kernel
def late_mps(p: PlantParams, s: PlantMemory, t_s: float, speed_mps: float) -> float:
    """The speed `lag_dead_s` ago; 0 before t = 0.

    Cell k of a line holds the speed at time k LAG_CELL_S. From the last filled cell to the present the speed is interpolated
    linearly, for steps of any number of cells.
    """
    length = len(s.lag_line)
    now = t_s / LAG_CELL_S
    last = s.lag_at
    speed_then_mps = s.lag_line[last % length]
    while s.lag_at + 1 <= now:
        s.lag_at += 1
        s.lag_line[s.lag_at % length] = speed_then_mps + (speed_mps - speed_then_mps) * (s.lag_at - last) / (now - last)
    back = now - p.lag_dead_s / LAG_CELL_S
    cell = math.floor(back)
    older = s.lag_line[cell % length]
    if cell >= s.lag_at:  # less than one cell ago
        return older + (back - cell) / max(now - cell, 1e-9) * (speed_mps - older)
    return older + (back - cell) * (s.lag_line[(cell + 1) % length] - older)


def _set_ageing(p: Any, _form: str, value: dict[str, float]) -> None:
    p.age_growth_N = value["ratio"] * p.F_s
    p.age_scale_s, p.age_exponent = value.get("age_scale_s", 1.0), value.get("exponent", 0.0)
    p.age_settling_s = value.get("settling_s", 0.0)
    p.age_rested_N = ageing_N(p, value.get("rested_s", 0.0))


def _set_lag(p: Any, _form: str, value: dict[str, float]) -> None:
    p.lag_s, p.lag_dead_s = value.get("lag_s", 0.0), value.get("delay_s", 0.0)
    p.lag_distance_m = value.get("distance_m", 0.0)
    p.late_share = value.get("share", 0.0) * (p.lag_dead_s > 0.0 or p.lag_distance_m > 0.0)


# the age at which the static friction equals F_s, which was measured after some rest
_RESTED = Parameter("rested_s", 0.0, 1e4, 0.0)
_AGEING = Effect(
    "friction",
    {
        "log": Formula(
            "F_s grows by ratio F_s ln(1 + age / age_scale_s), minus the growth at an age of rested_s",
            (ratio(0.02, 0.0, 1.0), Parameter("age_scale_s", 1e-4, 100.0, 0.1), _RESTED),
        ),
        "power": Formula(
            "F_s grows by ratio F_s (age / 1 s)^exponent, minus the growth at an age of rested_s",
            (ratio(0.04, 0.0, 1.0), Parameter("exponent", 0.05, 1.0, 0.3), _RESTED),
        ),
        "settling": Formula(
            "F_s grows by ratio F_s (1 - exp(-age / settling_s)), minus the growth at an age of rested_s",
            (ratio(0.05, 0.0, 1.0), Parameter("settling_s", 1e-4, 1e4, 0.5), _RESTED),
        ),
    },
    _set_ageing,
    numbers=("age_growth_N", "age_scale_s", "age_exponent", "age_settling_s", "age_rested_N"),
    switches=("age_growth_N",),
    off={"age_scale_s": 1.0},
    memory=(("age_s", "f8"),),
)
_LAG = Effect(
    "friction",
    {
        "time": Formula("the Stribeck curve sees v_r through a first-order lag", (Parameter("lag_s", 0.0, 1.0, 2e-3),)),
        "dead-time": Formula(
            "a share of the Stribeck curve sees |v_r| of delay_s ago",
            (Parameter("delay_s", 0.0, LONGEST_LAG_S, 2e-3), Parameter("share", 0.0, 1.0, 1.0)),
        ),
        "distance": Formula(
            "a share of the Stribeck curve sees |v_r| through a lag over the path slid; it holds while the contact rests",
            (Parameter("distance_m", 0.0, 1.0, 3e-6), Parameter("share", 0.0, 1.0, 1.0)),
        ),
    },
    _set_lag,
    numbers=("lag_s", "lag_dead_s", "lag_distance_m", "late_share"),
    switches=("lag_s", "lag_dead_s", "lag_distance_m"),
    memory=(("v_lag", "f8"), ("lag_line", "f8", (_LAG_LINE,)), ("lag_at", "i8")),
)
FRICTION_MEMORY: Final = {"static-friction-ageing": _AGEING, "frictional-lag": _LAG}
