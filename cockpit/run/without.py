"""The same run without its controller, simulated from the same rig and seed: what the controller made of it."""

from pathlib import Path
from tempfile import TemporaryDirectory

from bridge.log.damage import Damage
from cockpit.judge.judged import judge_log
from cockpit.judge.phases import Phase
from cockpit.judge.run_judge import RunJudge
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
    with TemporaryDirectory() as folder:
        path = Path(folder) / "without.mcap"
        if scenario.fault:
            run_with_faults(alone, path, {})
            return judge_log(path, stretch_from_s=from_s).judge.stretch
        judge = RunJudge(path, {}, stretch_from_s=from_s)
        judge.result(Damage(0, 0, closed=True), run_onboard(alone, path, {}, judge=judge), {})
        return judge.stretch
