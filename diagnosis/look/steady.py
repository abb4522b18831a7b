"""Whether breakaway or speed drifts over a record: a mean over a drift or over two speeds describes no state of the rig."""

import numpy as np

from bridge.units import prefixed
from diagnosis.look.numbers import slope_of
from diagnosis.look.speeds import VARIES
from diagnosis.look.sticks import Cycle

_FEWEST = 8  # fewest slips: fewer show a drift by chance
_SURE = 2.5  # smallest drift that is reported, in half intervals of 90 %
_OF_SWING = 0.1  # smallest drift, as a share of the fall in a slip: less changes no number beyond its reading accuracy


def unsteady(cycles: list[Cycle], unit: str) -> list[str]:
    """A message on a breakaway that drifts, and a message on sticks of several speeds where only one speed is known.

    Args:
        cycles: every slip of the record.
        unit: unit of the force; "1" for a coefficient.

    """
    tops = [cycle for cycle in cycles if np.isfinite(cycle.restick_force_N)]
    sticks = [cycle for cycle in cycles if np.isfinite(cycle.slope_N_per_s)]
    drifts = _drift(tops, "" if unit == "1" else unit) if len(tops) >= _FEWEST else []
    return drifts + (_speeds(sticks) if len(sticks) >= _FEWEST else [])


def _drift(tops: list[Cycle], unit: str) -> list[str]:
    t_s = np.array([cycle.breakaway_t_s for cycle in tops])
    rate = slope_of(t_s, np.array([cycle.breakaway_force_N for cycle in tops]), f"{unit}/s")
    drift = rate.value * float(np.ptp(t_s)) if rate is not None else 0.0
    swing = float(np.median([cycle.breakaway_force_N - cycle.restick_force_N for cycle in tops]))
    if rate is None or abs(rate.value) < _SURE * (rate.high - rate.value) or abs(drift) < _OF_SWING * swing:
        return []
    factor, shown = prefixed(abs(drift), unit) if unit else (1.0, "")
    verb, size = "rises" if drift > 0.0 else "falls", f"{abs(drift) * factor:.3g} {shown}".rstrip()
    return [
        f"no steady level: the breakaway {verb} by {size} over the record (running in, heat, zero of the sensor), and the "
        "numbers are means over it; look at a part of the record"
    ]


def _speeds(sticks: list[Cycle]) -> list[str]:
    speeds = [cycle.speed_mps for cycle in sticks if np.isfinite(cycle.speed_mps)]
    low, high = np.quantile([cycle.slope_N_per_s for cycle in sticks], [0.1, 0.9])
    if (speeds and max(speeds) > VARIES * min(speeds)) or not 0.0 < VARIES * low < high:
        return []
    return [
        f"no single speed: sticks climb by {low:.3g} to {high:.3g} a second, so stiffness and mass hold for none of them; give "
        "the drive's position, or look at a part with one speed"
    ]
