"""The same run without its controller, simulated with the same rig and seed, for comparison."""

from pathlib import Path
from tempfile import TemporaryDirectory

from bridge.log.damage import Damage
from bridge.log.storage.checksums import checksums_of
from cockpit.judge.judged import judge_log
from cockpit.judge.phases import Phase
from cockpit.judge.run_judge import RunJudge
from cockpit.run.in_process import run_onboard
from cockpit.run.scenario import LogTable, Scenario
from cockpit.run.simulated.log import run_with_faults


def without_controller(scenario: Scenario, from_s: float, seconds: float) -> Phase | None:
    """Figures of a stretch of the run simulated without vibration; None if no block is in the stretch. Raises Fault.

    Args:
        scenario: scenario of the run, with its faults.
        from_s: begin of the stretch.
        seconds: length of the run, and end of the stretch.

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
        run_onboard(alone, path, {}, judge=judge)
        judge.result(Damage(0, 0, closed=True), checksums_of(path), {})
        return judge.stretch
