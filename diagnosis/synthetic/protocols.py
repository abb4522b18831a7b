"""Protocols: the runs of a synthetic evidence folder, by name.

Two lengths of drive travel determine a stick-slip run with the paper's pair: the spring turns from +17 N to -17 N over 2.9 mm,
and a period takes about 0.5 mm. So a dwell lasts 0.25 s at 2 mm/s, 1 s at 0.5 mm/s and 5 s at 0.1 mm/s.
"""

from typing import Final, NamedTuple

_RAMP_S = 0.05  # duration of a change of velocity
_AMPLITUDE_M = 2e-8  # amplitude of the vibration in the paper


class Vibration(NamedTuple):
    """Command to the piezo from a time on; an amplitude of 0 turns it off."""

    from_s: float
    frequency_Hz: float
    amplitude_m: float


class RunPlan(NamedTuple):
    """A run with a spring drive."""

    velocity: tuple[tuple[float, float], ...]  # points [s, m/s], linear in between; one point: constant
    vibration: tuple[Vibration, ...] = ()
    duration_s: float = 10.0
    holdout: bool = False
    track: int = 0  # runs with the same number start at the same position


class AxisPlan(NamedTuple):
    """A run of a force-driven axis: the position follows a sum of sines, [amplitude m, frequency Hz] each."""

    sines: tuple[tuple[float, float], ...]
    duration_s: float = 12.0
    holdout: bool = False


def _steps(*steps: tuple[float, float]) -> tuple[tuple[float, float], ...]:
    """A velocity profile that changes to each velocity at its time, over a short ramp."""
    points = [steps[0]]
    for time_s, velocity_mps in steps[1:]:
        points += [(time_s, points[-1][1]), (time_s + _RAMP_S, velocity_mps)]
    return tuple(points)


def _constant(velocity_mps: float) -> tuple[tuple[float, float], ...]:
    return ((0.0, velocity_mps),)


def _vibration(*steps: tuple[float, float]) -> tuple[Vibration, ...]:
    """Vibration with the paper's amplitude: [s, Hz] each, from this time on; a frequency of 0 is off."""
    return tuple(Vibration(time_s, f_Hz, _AMPLITUDE_M if f_Hz > 0.0 else 0.0) for time_s, f_Hz in steps)


PROTOCOLS: Final[dict[str, tuple[RunPlan, ...]]] = {
    # the shortest protocol that separates ageing, direction, position, piezo and drive
    "ladder": (
        RunPlan(_constant(0.0005), track=0),
        # 3 mm forward; 5 mm back, of which 2.1 mm slide; 0.9 mm of slow drag with dwells of 3 s
        RunPlan(_steps((0.0, 0.002), (1.5, -0.002), (4.0, -0.00015)), track=1),
        # frequencies in no order: if they rose with time, a roll-off would look like an exciter that warms up
        RunPlan(_constant(0.0005), _vibration((2.0, 3000.0), (4.0, 1000.0), (6.0, 4500.0), (8.0, 2000.0)), track=2),
        RunPlan(
            _steps((0.0, 0.0007), (5.0, -0.002), (7.2, -0.0002)),
            _vibration((2.5, 2500.0), (5.0, 0.0)),
            holdout=True,
            track=3,
        ),
    ),
    # "ladder" in a third of the time, with dwells of 0.25 to 0.8 s only
    "short": (
        RunPlan(_steps((0.0, 0.002), (2.5, -0.002)), duration_s=5.0, track=0),
        RunPlan(_constant(0.0006), _vibration((1.5, 3000.0), (2.7, 1200.0), (3.9, 4500.0)), duration_s=5.0, track=1),
        RunPlan(_constant(0.0015), _vibration((2.5, 2500.0)), duration_s=4.0, holdout=True, track=2),
    ),
    "constant": (
        RunPlan(_constant(0.0005), track=0),
        RunPlan(_constant(0.002), track=1),
        RunPlan(_constant(0.0005), _vibration((2.0, 3000.0)), track=2),
        RunPlan(_constant(0.001), _vibration((2.0, 2000.0)), holdout=True, track=3),
    ),
    # the paper's procedure: the slide returns to the same position before each run
    "paper": (
        RunPlan(_constant(0.0005)),
        RunPlan(_constant(0.0005), _vibration((4.0, 2000.0))),
        RunPlan(_constant(0.0005), _vibration((4.0, 4000.0))),
        RunPlan(_constant(0.0005), _vibration((4.0, 3000.0)), holdout=True),
    ),
    "slow": (
        RunPlan(_constant(0.0001), duration_s=30.0, track=0),
        RunPlan(_constant(0.0005), track=1),
        RunPlan(_constant(0.002), duration_s=6.0, track=2),
        RunPlan(_constant(0.001), holdout=True, track=3),
    ),
}

FORCE_PROTOCOL: Final = "force"
# fast and long; fast and short; slow, with a stick at each turn; and a mixture, held out. Peak speeds of 0.04 to 0.16 m/s.
AXIS_PLANS: Final[tuple[AxisPlan, ...]] = (
    AxisPlan(((0.1, 0.25),)),
    AxisPlan(((0.02, 1.0),)),
    AxisPlan(((0.05, 0.125),)),
    AxisPlan(((0.07, 0.2), (0.015, 0.7)), holdout=True),
)
