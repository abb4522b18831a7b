"""Compile every kernel once, before worker processes would each do it for themselves; `python -m tests.warm_up`.

Nothing is done where it was done for the same sources.
"""

import sys
import tempfile
from pathlib import Path

from bridge.kernel_cache import mark_of, usable_folder
from tests.made_evidence import forget_old

DONE = usable_folder() / mark_of("tests", Path(__file__))


def control(folder: Path) -> None:
    """Plant, device, controller, log and replay."""
    from bridge.log.logfile import read_run
    from bridge.rig.device_node import DeviceNode
    from bridge.rig.faults.schedule import Faults
    from cockpit.run.in_process import run_onboard
    from cockpit.run.replay import changes_of
    from cockpit.run.scenario import load_scenario
    from controller.node import ControllerNode
    from controller.replay import replay
    from plant.records import guard_records
    from plant.rig.device import PlantDevice
    from plant.rig.node import PlantNode

    scenario = load_scenario("paper-c45-c45", ["duration_s=0.4"])
    PlantNode(scenario.rig, scenario.seed).warm_up()
    ControllerNode(scenario.controller).warm_up()
    rig = scenario.rig
    faults = Faults((), 1, rig.solver.block_s, rig.solver.samples_per_block)
    DeviceNode(PlantDevice(rig, 1), guard_records(rig, 1, arm=False), faults).advance([])
    run_onboard(scenario, folder / "run.mcap", {})
    run = read_run(folder / "run.mcap")
    replay(run, changes_of(run, []))


def guard() -> None:
    """By itself, as its unit tests call it: they are several files, and each worker would compile it."""
    from tests.unit.bridge.guard.rigs import Rig

    Rig().run(1)


def bench_of_the_controller() -> None:
    """The rig with its judge, with the controller and with the rules."""
    from bench.control.cost import step_cost_ratio
    from bench.control.scenario import load_bank
    from bench.control.suite import warm_up

    warm_up(load_bank()[0])
    step_cost_ratio()


def diagnosis() -> None:
    """The model alone and four rigs at once, for a rig moved by a spring and for a rig moved by a motor force."""
    import numpy as np

    from diagnosis.hypotheses.hypothesis import NOTHING
    from tests.prepared import fitter_of, prepared

    for protocol in ("short", "force"):
        fitter = fitter_of(*prepared(protocol))
        fitter.refit(NOTHING, np.zeros(len(fitter.nuisances)), np.zeros(0))


def generator(folder: Path) -> None:
    """The rigs of the blind check, whose formulas are their own."""
    from tests.blind.generators import Plan
    from tests.blind.independent_cases import Independent
    from tests.blind.small_set import RUNS

    Independent(RUNS[1:2]).make(folder, Plan(), 1)


if __name__ == "__main__":
    forget_old()
    if not DONE.exists():
        print("compiling kernels (once for these sources)", file=sys.stderr, flush=True)
        with tempfile.TemporaryDirectory() as folder:
            control(Path(folder))
            generator(Path(folder) / "rig")
        guard()
        bench_of_the_controller()
        diagnosis()
        DONE.touch()
