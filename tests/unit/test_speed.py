"""The bench's truth and the solvers that it compares agree, so that its table compares like with like."""

import pytest

from tests.speed.case import Case, error_ms, unvibrated
from tests.speed.kernel import STEPS_S
from tests.speed.mujoco_joint import mujoco
from tests.speed.solvers import lsoda, ours


@pytest.fixture(scope="module")
def first_slip() -> Case:
    return unvibrated(duration_s=3.1)


@pytest.mark.slow
def test_truth_slips_once(first_slip: Case) -> None:
    # "at about t = 3 s" in the paper's numbers
    assert first_slip.slips_s == pytest.approx([2.978], abs=1e-3)


def test_our_kernel_agrees_with_the_truth(first_slip: Case) -> None:
    run = ours(first_slip, 1e-5)
    assert error_ms(first_slip, run.t_s, run.velocity_mps) < 0.005


@pytest.mark.parametrize("step_s", STEPS_S)
def test_the_rig_takes_every_step_of_the_bench(first_slip: Case, step_s: float) -> None:
    assert ours(first_slip, step_s).wall_s > 0.0


def test_lsoda_agrees_with_the_truth(first_slip: Case) -> None:
    run = lsoda(first_slip, (1e-8, 1e-12))
    assert error_ms(first_slip, run.t_s, run.velocity_mps) < 0.005


def test_mujoco_runs_the_same_rig(first_slip: Case) -> None:
    pytest.importorskip("mujoco", reason="MuJoCo is in the bench extra only")
    run = mujoco(first_slip, ("Euler", 2e-5))
    assert error_ms(first_slip, run.t_s, run.velocity_mps) < 0.2
