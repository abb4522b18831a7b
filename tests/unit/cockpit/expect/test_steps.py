"""Steps of a scenario: refused where they have no meaning, and equal in both kinds of run in one process."""

from pathlib import Path

import numpy as np
import pytest

from bridge.faults import Fault
from bridge.log.logfile import read_run
from cockpit.run.in_process import run_onboard
from cockpit.run.replay import replay_log
from cockpit.run.run_tables import refuse_for_processes
from cockpit.run.scenario import Scenario, load_scenario
from cockpit.run.simulated.run import run_with_faults

HEAD = 'duration_s = 1.0\narm = true\nrig = { file = "paper-c45-c45" }\n'
STEPS = """
[[step]]
at_s = 0.2
speed_mps = 0.0008
[[step]]
at_s = 0.4
settings = ["controller.limits.v_ratio=1.4"]
[[step]]
at_s = 0.6
load = 0.2
[[step]]
at_s = 0.8
command = "STOP"
"""


def scenario(tmp_path: Path, text: str) -> Scenario:
    path = tmp_path / "steps.toml"
    path.write_text(HEAD + text)
    return load_scenario(str(path), [])


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("[[step]]\nat_s = 0.5", "no change given: must be one of command"),
        ('[[step]]\nat_s = 0.5\nload = 2.0\ncommand = "STOP"', "command and load given: must be one of"),
        ("[[step]]\nat_s = 1.0\nload = 2.0", "step.0.at_s = 1: must not be after the end of the run, duration_s = 1"),
        ('[[step]]\nat_s = 0.5\nsettings = ["rig.slide.mass_kg=2"]', "must be controller.KEY=VALUE"),
        ('[[step]]\nat_s = 0.5\nsettings = ["controller.limits.v_rato=2"]', "v_rato = 2: unknown key; perhaps v_ratio"),
        ("[[expect]]\nslips = 0\nfrom_s = 1.5", "expect.0.from_s = 1.5: must not be after the end of the run"),
        ("[[expect]]\nslips = 0\nto_s = 1.5", "expect.0.to_s = 1.5: must not be after the end of the run"),
        ('[[expect]]\nevent = "STALE"\nfrom_s = 0.5\nwithin_s = 1.0', "expect.0.within_s = 1: must not be after"),
    ],
)
def test_a_step_or_window_without_meaning_is_refused(tmp_path: Path, text: str, line: str) -> None:
    with pytest.raises(Fault) as refused:
        scenario(tmp_path, text)
    assert line in refused.value.line


def test_a_speed_needs_a_profile() -> None:
    moves = "rig.drive.moves=[{ distance_m = 0.001, velocity_mps = 0.001, acceleration_mps2 = 0.1, jerk_mps3 = 10.0 }]"
    with pytest.raises(Fault, match="must run a profile once"):
        load_scenario("from-the-start", ["duration_s=2.0", moves, "step=[{ at_s = 1.0, speed_mps = 0.001 }]"])


@pytest.mark.slow
def test_steps_act_alike_with_and_without_the_loops_of_the_processes(tmp_path: Path) -> None:
    made = scenario(tmp_path, STEPS)
    logs = {run: tmp_path / f"{run.__name__}.mcap" for run in (run_onboard, run_with_faults)}
    for run, path in logs.items():
        run(made, path, {})
        assert replay_log(path, 0.0, []).identical
    onboard, simulated = (read_run(path) for path in logs.values())
    for name in ("drive_velocity_mps", "velocity_ratio", "drive_force_N"):
        np.testing.assert_array_equal(onboard.trace[name], simulated.trace[name])
    assert onboard.trace["drive_velocity_mps"][395] == pytest.approx(8e-4, rel=0.02)
    assert onboard.applied["amplitude_m"][-1] == 0.0
    heavy = tmp_path / "heavy.mcap"
    run_onboard(made.model_copy(update={"step": [step for step in made.step if step.load is None]}), heavy, {})
    at = 795  # 0.2 s after the load fell to a fifth
    assert onboard.trace["drive_force_N"][at] < 0.5 * read_run(heavy).trace["drive_force_N"][at]


def test_runs_of_several_processes_refuse_steps(tmp_path: Path) -> None:
    with pytest.raises(Fault, match="use `stickslip test`, or --in-process"):
        refuse_for_processes(scenario(tmp_path, STEPS), lockstep=False)
