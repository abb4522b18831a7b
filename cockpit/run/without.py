"""The same run without its controller, simulated from the same rig and seed: what the controller made of it."""

from pathlib import Path
from tempfile import TemporaryDirectory

from bridge.log.logfile import read_run
from cockpit.judge.phases import Phase
from cockpit.judge.verdict import stretch_of
from cockpit.run.in_process import run_onboard
from cockpit.run.scenario import LogTable, Scenario
from cockpit.run.simulated.log import run_with_faults


def without_controller(scenario: Scenario, from_s: float, seconds: float) -> Phase | None:
    """What happens in a stretch of a run in which nothing vibrates; None where there is no block in it. Raises Fault.

    Args:
        scenario: of the run; with its faults.
        from_s: begin of the stretch.
        seconds: length of the run, which the stretch goes on to.

    """
    policy = scenario.controller.policy.model_copy(update={"enabled_from_s": seconds + 1.0})
    controller = scenario.controller.model_copy(update={"policy": policy})
    log = LogTable(file_MB=0.0, file_s=0.0)
    alone = scenario.model_copy(update={"controller": controller, "duration_s": seconds, "log": log})
    simulate = run_with_faults if scenario.fault else run_onboard
    with TemporaryDirectory() as folder:
        path = Path(folder) / "without.mcap"
        simulate(alone, path, {})
        return stretch_of(read_run(path), from_s, seconds)
