"""Results that no rig has: a wrong time, unit or column is the likelier cause, so they are asked about and not printed."""

import numpy as np

from bridge.faults import Fault
from diagnosis.look.look import LookResult

# Limits beyond any rig. Wider: a record in milliseconds that was read in seconds passes. Narrower: MEMS sliders (micrograms) and
# bowed strings (6e4 slips a minute) are refused.
_LEAST_MASS_kg, _MOST_SLIPS_PER_MIN, _FASTEST_MPS = 1e-6, 1e5, 100.0


def refuse_absurd(seen: LookResult, file: str, counts: str = "") -> None:
    """Raise Fault CONFIG, with the question to answer, for a mass, a rate of slips or a speed that no rig has.

    Also for a time in whole numbers without a unit, `counts`, in a record with slips: it may count milliseconds.
    """
    mass, per_min = seen.numbers.get("mass_kg"), 60.0 * seen.slips / seen.seconds
    speeds = np.array([cycle.speed_mps for cycle in seen.cycles])
    fastest = float(np.nanmax(np.abs(speeds))) if np.isfinite(speeds).any() else 0.0
    of_time = 'is the time right? add --time "NAME [ms]" or --rate 1kHz'
    if counts and seen.sticks:
        line = f'the time {counts!r} counts whole numbers and states no unit: add --time "{counts} [ms]" or --time "{counts} [s]"'
    elif per_min > _MOST_SLIPS_PER_MIN:
        line = f"{per_min:.3g} slips per minute: more than {_MOST_SLIPS_PER_MIN:g}, so no rig's: {of_time}"
    elif fastest > _FASTEST_MPS and not seen.known.torsion:
        line = f"a drive at {fastest:.3g} m/s: more than {_FASTEST_MPS:g}, so no rig's: is its position right? "
        line += 'Add --position "NAME [mm]" or --speed 0.5mm/s'
    elif mass is not None and mass.value < _LEAST_MASS_kg and not seen.known.torsion:
        line = f"a slide of {mass.value:.3g} kg: less than {_LEAST_MASS_kg:g} kg, so no rig's: {of_time}, or --speed 0.5mm/s"
    else:
        return
    raise Fault("CONFIG", f"{file}: {line}")
