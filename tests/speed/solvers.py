"""Ours and SciPy's, each a function of a case and a setting. Only the stepping is on the clock."""

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import odeint, solve_ivp

from bridge.kernel import kernel
from bridge.wire.channels import CHANNELS
from plant.config import RigConfig
from plant.records import TRUTH, build
from plant.simulate import run_blocks
from tests.speed import case as paper
from tests.speed.case import Case, Floats, derivatives

BLOCK_S = 1e-3


class Run(NamedTuple):
    wall_s: float
    t_s: Floats
    velocity_mps: Floats


Solver = Callable[[Case, Any], Run]


def ours(case: Case, step_s: float) -> Run:
    """The rig's kernel as the rig runs it: 1 ms blocks, with exciter and the sensors' analogue filters."""
    steps = round(BLOCK_S / step_s)
    samples = next(n for n in (20, 15, 10, 5) if steps % n == 0)
    config = RigConfig.model_validate(
        {
            "contact": {"pair": paper.PAIR},
            "solver": {"step_s": BLOCK_S / steps, "samples_per_block": samples},
            # the rig refuses steps above a 20th of the exciter's shortest period; at rest any step will do
            "piezo": {
                "amplitude_slew_m_per_s": 0.0,
                "frequency_min_Hz": 100.0,
                "frequency_max_Hz": min(5000.0, 0.05 / step_s),
            },
        }
    )
    params, state = build(config)
    s = state[0]
    s.x, s.v, s.z = case.start
    s.s_d = paper.DRIVE_VELOCITY_MPS * case.from_s
    s.v_r = s.v
    blocks = round(case.duration_s / BLOCK_S)
    each = np.ones(blocks)
    drive, frequency, amplitude = (
        each * paper.DRIVE_VELOCITY_MPS,
        each * case.frequency_Hz,
        each * case.amplitude_m,
    )
    analogue, truth = (np.empty((len(rows), blocks * samples)) for rows in (CHANNELS, TRUTH))
    begin = time.perf_counter()
    run_blocks(params, state, drive, frequency, amplitude, analogue, truth)
    wall_s = time.perf_counter() - begin
    t_s = case.from_s + (np.arange(blocks * samples) + 1) * (BLOCK_S / samples)
    return Run(wall_s, t_s, truth[TRUTH.index("true_velocity_mps")])


@kernel
def _rates(t_s: float, y: Floats, v_a: float, omega: float) -> Floats:
    out = np.empty(3)
    out[0], out[1], out[2] = derivatives(t_s, y[0], y[1], y[2], v_a, omega)
    return out


def _sample_times(case: Case) -> Floats:
    return case.from_s + np.arange(round(case.duration_s / paper.SAMPLE_S) + 1) * paper.SAMPLE_S


def lsoda(case: Case, tolerances: tuple[float, float]) -> Run:
    """SciPy's odeint: the loop of LSODA is compiled, unlike the loop of solve_ivp."""
    rtol, atol = tolerances
    t_s = _sample_times(case)
    arguments = (case.base_velocity_mps, case.omega)
    begin = time.perf_counter()
    y: Any = odeint(_rates, case.start, t_s, args=arguments, tfirst=True, rtol=rtol, atol=atol, mxstep=10**7)
    return Run(time.perf_counter() - begin, t_s, y[:, 1])


def lsoda_in_blocks(case: Case, tolerances: tuple[float, float]) -> Run:
    """LSODA restarted every 1 ms, as for a rig with a new command in every block."""
    rtol, atol = tolerances
    t_s = _sample_times(case)
    arguments = (case.base_velocity_mps, case.omega)
    per_block = round(BLOCK_S / paper.SAMPLE_S)
    y = np.empty((len(t_s), 3))
    y[0] = case.start
    begin = time.perf_counter()
    for i in range(0, len(t_s) - 1, per_block):
        block = slice(i, i + per_block + 1)
        y[block] = odeint(_rates, y[i], t_s[block], args=arguments, tfirst=True, rtol=rtol, atol=atol, mxstep=10**7)
    return Run(time.perf_counter() - begin, t_s, y[:, 1])


def radau(case: Case, tolerances: tuple[float, float]) -> Run:
    """SciPy's solve_ivp with Radau."""
    rtol, atol = tolerances
    t_s = _sample_times(case)
    begin = time.perf_counter()
    solution: Any = solve_ivp(
        _rates,
        (t_s[0], t_s[-1]),
        case.start,
        method="Radau",
        t_eval=t_s,
        args=(case.base_velocity_mps, case.omega),
        rtol=rtol,
        atol=atol,
    )
    return Run(time.perf_counter() - begin, t_s, solution.y[1])
