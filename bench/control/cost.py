"""Time of a controller step over the time to simulate a block of the paper's rig."""

import time

import numpy as np

from bridge.arrays import Records
from bridge.kernel import kernel
from bridge.wire.messages import BLOCK, COMMAND, TRACE
from cockpit.run.closed_loop import ClosedLoop
from cockpit.run.scenario import load_scenario
from controller.core import step
from controller.records import build as controller_records
from plant.records import build as plant_records
from plant.simulate import run_blocks

_BLOCKS = 4000  # simulated blocks of the paper's rig, which vibrates in most of them
_TURNS = 25  # measurements of each time, in turns; the shortest counts


@kernel
def _steps(params: Records, state: Records, sensors: Records, command: Records, trace: Records) -> None:
    for i in range(sensors.shape[0]):
        step(params, state, sensors[i : i + 1], BLOCK, 0, sensors[i].t_ns, command, trace)


def step_cost_ratio() -> float:
    """Time of a controller step over time to simulate a block of a vibrated rig; each is the shortest of 25."""
    scenario = load_scenario("from-the-start", [])
    loop = ClosedLoop(scenario.rig, scenario.seed, scenario.controller, scenario.arm)
    sensors = loop.advance(_BLOCKS).sensors
    samples = scenario.rig.solver.samples_per_block
    drive_mps, frequency_Hz, amplitude_m = np.full(_BLOCKS, 5e-4), np.full(_BLOCKS, 2600.0), np.full(_BLOCKS, 3.7e-8)
    analogue, truth = np.empty((5, _BLOCKS * samples)), np.empty((6, _BLOCKS * samples))

    def of_steps() -> float:
        params, state = controller_records(scenario.controller)
        begun_s = time.perf_counter()
        _steps(params, state, sensors, COMMAND.blank(), TRACE.blank())
        return time.perf_counter() - begun_s

    def of_blocks() -> float:
        params, state = plant_records(scenario.rig)
        begun_s = time.perf_counter()
        run_blocks(params, state, drive_mps, frequency_Hz, amplitude_m, analogue, truth)
        return time.perf_counter() - begun_s

    of_steps()  # the first call of each compiles its kernels
    of_blocks()
    turns = [(of_steps(), of_blocks()) for _ in range(_TURNS)]
    return min(steps_s for steps_s, _ in turns) / min(blocks_s for _, blocks_s in turns)
