"""Faults of a force sensor added to real logs: the rest of the evidence is as measured.

The rig tables describe the clean logs, so a fault differs from them. The clean rigs already have gaps to
any simple model (docs/quality/results.md): the fault is the largest new gap, and not the only one.
"""

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter

from tests.real.evidences import AXIS, MISSING, SLIDER, Cut, Levels, axis, slider

Floats = npt.NDArray[np.float64]
Sensor = Callable[[Floats, Floats], Floats]  # from time [s] and force [N] to the shown force [N]

_LEVEL_TOLERANCE = 0.03  # of the friction that the clean log itself shows
_DEAD_TIME_S = 0.012  # the axis turns round within 0.1 s
_AXIS_OFFSET_N = -3.16  # published for the clean axis; a bias is added to this offset


class RealCase(NamedTuple):
    """One evidence that can be written, with the fault in it and the fault's size."""

    write: Callable[[Path], None]
    effects: tuple[str, ...]
    numbers: dict[str, float]


class Rig(NamedTuple):
    """A real log that faults are added to, with the scales of a large fault."""

    write: Callable[[Path, Sensor], None]
    force_N: float  # friction force
    begins_s: float  # start, on the clock of the log
    lasts_s: float
    lag_s: float  # a lag that clearly changes the fastest motion of the log
    offset_N: float
    faults: tuple[str, ...]


def gain(ratio: float) -> Sensor:
    """A sensor that shows 1 + ratio times the force."""
    return lambda _t_s, force_N: (1.0 + ratio) * force_N


def bias(bias_N: float) -> Sensor:
    """A sensor whose zero is off."""
    return lambda _t_s, force_N: force_N + bias_N


def drift(rate_N_per_s: float, begins_s: float) -> Sensor:
    """A sensor whose zero wanders evenly from `begins_s` on, over all runs that share the clock."""
    return lambda t_s, force_N: force_N + rate_N_per_s * (t_s - begins_s)


def lag(delay_s: float) -> Sensor:
    """An amplifier with two equal poles; slow signals come `delay_s` late."""

    def shown(t_s: Floats, force_N: Floats) -> Floats:
        keep = float(np.exp(-np.median(np.diff(t_s)) / (0.5 * delay_s)))
        result = force_N
        for _ in range(2):
            # settled at the first sample
            result, _end = lfilter([1.0 - keep], [1.0, -keep], result, zi=[keep * result[0]])
        return result

    return shown


def dead_time(delay_s: float) -> Sensor:
    """A sensor that shows everything `delay_s` late."""
    return lambda t_s, force_N: np.interp(t_s - delay_s, t_s, force_N)


def _slider(folder: Path, sensor: Sensor, cuts: tuple[Cut, ...], levels: Levels) -> None:
    slider(folder, 168.0, levels, cuts, sensor, _LEVEL_TOLERANCE)


_FAST = (Cut("k168Nm_v1100", 1.1e-3, 0.0, 9.0), Cut("k168Nm_v1100", 1.1e-3, 9.0, 14.4, holdout=True))
_SLOW = (Cut("k168Nm_v42", 4.2e-5, 0.0, 60.0), Cut("k168Nm_v42", 4.2e-5, 60.0, 100.0, holdout=True))
_LEVEL_FAULTS = ("force-sensor-gain", "force-sensor-bias", "force-sensor-drift")
# The slider measures the force alone: a dead time moves the whole record, so no feature shows it.
RIGS = {
    "slider-fast": Rig(
        partial(_slider, cuts=_FAST, levels=Levels(0.362, 0.332)),
        0.1, 3.5895, 14.4, 0.04, 0.0, (*_LEVEL_FAULTS, "force-sensor-lag"),
    ),
    "slider-slow": Rig(
        partial(_slider, cuts=_SLOW, levels=Levels(0.323, 0.303)), 0.09, 93.9095, 100.0, 0.05, 0.0, _LEVEL_FAULTS,
    ),
    "axis": Rig(
        axis, 20.4, 0.0, 24.84, 0.04, _AXIS_OFFSET_N, (*_LEVEL_FAULTS, "force-sensor-lag", "force-sensor-delay"),
    ),
}  # fmt: skip


def real_cases(random: np.random.Generator) -> Iterator[RealCase]:
    """Every fault on every rig that could show it, twelve cases, with sizes drawn. Raises FileNotFoundError without the logs."""
    if not (SLIDER.is_dir() and AXIS.is_dir()):
        raise FileNotFoundError(MISSING)
    for rig in RIGS.values():
        for fault in rig.faults:
            size = float(random.uniform(0.5, 1.0))
            sign = float(random.choice([-1.0, 1.0]))
            sensor, numbers = _sized(fault, size, sign, rig)
            yield RealCase(partial(rig.write, sensor=sensor), (fault,), numbers)


def _sized(fault: str, size: float, sign: float, rig: Rig) -> tuple[Sensor, dict[str, Any]]:
    """A fault of 0.5 to 1 times a large one on this rig; its numbers describe the whole sensor, against the rig table."""
    if fault == "force-sensor-gain":
        return gain(0.3 * sign * size), {"ratio": 0.3 * sign * size}
    if fault == "force-sensor-bias":
        bias_N = 0.5 * sign * size * rig.force_N
        return bias(bias_N), {"bias_N": bias_N + rig.offset_N}
    if fault == "force-sensor-drift":
        rate_N_per_s = 0.8 * sign * size * rig.force_N / rig.lasts_s
        return drift(rate_N_per_s, rig.begins_s), {"rate_N_per_s": rate_N_per_s}
    if fault == "force-sensor-lag":
        return lag(rig.lag_s * size), {"delay_s": rig.lag_s * size}
    return dead_time(_DEAD_TIME_S * size), {"delay_s": _DEAD_TIME_S * size}
