"""Estimate of the mass from the runs, for an owner who cannot weigh it."""

import numpy as np

from bridge.arrays import Floats
from diagnosis.evidence.manifest import RigTable, RunTable
from diagnosis.evidence.manifest_keys import Columns
from diagnosis.look.look import RecordFacts, look

_WINDOW_S = 0.03  # window of the cubic that smooths a position before it is differentiated twice
# share of the fastest speed below which samples are left out: friction turns, and is not linear in the speed
_SLOW = 0.1


def shown_mass_kg(rig: RigTable, table: RunTable, columns: Columns) -> float | None:
    """The mass from one run [samples]: from its slips on a spring, from force over acceleration on an axis; None: unknown."""
    force_N = columns.get("drive_force_N")
    if force_N is None:
        return None
    if rig.drive == "force":
        return _accelerated(force_N, columns)
    seen = look(
        columns["t_s"], force_N, columns.get("drive_position_m"), RecordFacts(speed_mps=table.drive_velocity_mps)
    )
    number = None if seen is None else seen.numbers.get("mass_kg")
    return None if number is None or not 0.0 < number.low < number.value else number.value


def _accelerated(force_N: Floats, columns: Columns) -> float | None:
    """Mass from force over acceleration, fitted together with Coulomb friction, viscous friction and a constant force."""
    from scipy.signal import savgol_filter  # noqa: PLC0415  0.7 s of CPU, which `look` alone would pay

    step_s = float(np.median(np.diff(columns["t_s"])))
    window = max(2 * round(0.5 * _WINDOW_S / step_s) + 1, 5)
    position_m, accel = columns.get("mass_position_m"), columns.get("mass_accel_mps2")
    if position_m is None or len(force_N) < 2 * window:
        return None
    velocity = np.asarray(savgol_filter(position_m, window, 3, deriv=1, delta=step_s), np.float64)
    if accel is None:
        accel = np.asarray(savgol_filter(position_m, window, 3, deriv=2, delta=step_s), np.float64)
    moves = np.abs(velocity) > _SLOW * np.abs(velocity).max()
    design = np.stack([accel, velocity, np.sign(velocity), np.ones(len(velocity))], axis=1)[moves]
    if len(design) < window or np.linalg.matrix_rank(design) < design.shape[1]:
        return None
    mass_kg = float(np.linalg.lstsq(design, force_N[moves], rcond=None)[0][0])
    return mass_kg if mass_kg > 0.0 else None
