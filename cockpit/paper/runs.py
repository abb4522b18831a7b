"""The paper's runs, redone: every pair, pressure and frequency, and the measurements of each run."""

import math
from typing import Final, NamedTuple

import numpy as np

from bridge.arrays import Floats
from bridge.config import validate
from diagnosis.slips import find_cycles
from plant.config import RigConfig
from plant.pairs import PAIRS
from plant.simulate import Simulation, simulate

STEEL_PAIRS: Final = tuple(pair for pair in PAIRS if "PTFE" not in pair)
PTFE_PAIRS: Final = tuple(pair for pair in PAIRS if "PTFE" in pair)
FREQUENCIES_HZ: Final = (0, 1000, 2000, 3000, 4000, 5000)
AMPLITUDE_M: Final = 2e-8
DRIVE_VELOCITY_MPS: Final = 0.0005
VIBRATION_FROM_S: Final = 8.0
DURATION_S: Final = 20.0
CYCLES_FROM_S: Final = 10.5
# When the vibration starts, the loaded spring releases one slip (36 ms), which is over by this time.
RELEASED_S: Final = 8.1
# At 5 kHz the force still climbs by 0.1 N from 10.5 s on; from 16 s on it changes by less than 0.03 N.
SETTLED_FROM_S: Final = 16.0

# Below 2 kHz a run is chaotic: the phase at which the vibration starts determines the next cycles, and the mean period
# of a run scatters by 0.8 %. The mean of 16 starts, spread over two seconds, scatters by 0.2 %.
ENSEMBLE_BELOW_HZ: Final = 2000
ENSEMBLE_STARTS_S: Final = tuple(VIBRATION_FROM_S + 0.131 * start for start in range(16))

Key = tuple[str, int]


class Course(NamedTuple):
    """Time courses for the figures, one point per millisecond: force [N], position of slide and drive [m]."""

    t_s: Floats
    drive_force_N: Floats
    position_m: Floats
    drive_position_m: Floats


class Measured(NamedTuple):
    """Measurements of one run: means of cycles over t = 10.5-20 s, and the mean force over t = 16-20 s.

    The first five are nan without slips over t = 10.5-20 s. `late_slips` is the number of slips from RELEASED_S on.
    """

    force_max_N: float
    force_min_N: float
    period_s: float
    stick_s: float
    swing_N: float
    settled_force_N: float
    late_slips: float


class PairRun(NamedTuple):
    """One pair at one frequency: course of the run that starts at 8 s, mean and scatter over all starts."""

    course: Course
    starts: int
    mean: Measured
    scatter: Measured


class Slip(NamedTuple):
    """One undisturbed slip of a pair in detail; `peak_accel_mps2` is a magnitude, reached at re-stick."""

    first_breakaway_s: float
    duration_s: float
    peak_velocity_mps: float
    peak_accel_mps2: float
    climb_N_per_s: float  # rise of the drive force between two slips


def vibration_velocity_mps(frequency_Hz: float) -> float:
    """v_a = 2 pi f u0 [m/s] at the paper's amplitude of 0.02 um."""
    return 2.0 * math.pi * frequency_Hz * AMPLITUDE_M


def paper_rig(pair: str) -> RigConfig:
    """The paper's rig with a pair of `plant.pairs`; the vibration reaches its amplitude at once."""
    table = {"contact": {"pair": pair}, "piezo": {"amplitude_slew_m_per_s": 0.0}}
    return validate(RigConfig, table, "paper")


def starts_s(frequency_Hz: int) -> tuple[float, ...]:
    """Start times of the vibration in the averaged runs."""
    return ENSEMBLE_STARTS_S if 0 < frequency_Hz < ENSEMBLE_BELOW_HZ else (VIBRATION_FROM_S,)


def plan() -> list[Key]:
    """All pairs and frequencies of the paper; PTFE, which does not stick, only without vibration."""
    return [(pair, f) for pair in STEEL_PAIRS for f in FREQUENCIES_HZ] + [(pair, 0) for pair in PTFE_PAIRS]


def run(pair: str, frequency_Hz: int) -> PairRun:
    """Simulate one pair at one frequency from all its starts."""
    rig = paper_rig(pair)
    measured: list[Measured] = []
    course: Course | None = None
    for start_s in starts_s(frequency_Hz):
        simulation = simulate(rig, DURATION_S, frequency_Hz, AMPLITUDE_M if frequency_Hz else 0.0, start_s)
        measured.append(measure(simulation))
        course = course or _course(simulation, rig.solver.samples_per_block)
    assert course is not None  # noqa: S101 - every frequency has a start
    values = np.array(measured)
    return PairRun(
        course, len(measured), Measured(*values.mean(axis=0).tolist()), Measured(*values.std(axis=0).tolist())
    )


def measure(simulation: Simulation) -> Measured:
    """Cycle means and settled level of one 20 s run."""
    cycles = find_cycles(simulation.t_s, simulation.drive_force_N)
    late = cycles.between(CYCLES_FROM_S, DURATION_S)
    settled_N = simulation.drive_force_N[simulation.t_s > SETTLED_FROM_S]
    return Measured(
        late.force_max_N,
        late.force_min_N,
        late.period_s,
        late.stick_s,
        late.swing_N,
        float(settled_N.mean()),
        cycles.between(RELEASED_S, math.inf).slips,
    )


def _course(simulation: Simulation, samples_per_block: int) -> Course:
    every = slice(samples_per_block - 1, None, samples_per_block)
    return Course(*(getattr(simulation, name)[every].copy() for name in Course._fields))


def one_slip(pair: str) -> Slip:
    """The first slip of a pair without vibration, and the climb of the force up to the second."""
    rig = paper_rig(pair)
    simulation = simulate(rig, DURATION_S / 2)
    t_s, force_N = simulation.t_s, simulation.drive_force_N
    cycles = find_cycles(t_s, force_N)
    restick_s, next_s = cycles.restick_t_s[0], cycles.breakaway_t_s[1]
    # the middle half of the stick, clear of the creep before the breakaway
    low, high = np.searchsorted(t_s, (restick_s + np.array([0.25, 0.75]) * (next_s - restick_s)))
    return Slip(
        float(cycles.breakaway_t_s[0]),
        float(restick_s - cycles.breakaway_t_s[0]),
        float(simulation.velocity_mps.max()),
        float(np.abs(force_N - simulation.friction_force_N).max() / rig.slide.mass_kg),
        float((force_N[high] - force_N[low]) / (t_s[high] - t_s[low])),
    )
