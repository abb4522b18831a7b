"""The public EMPS ball-screw axis: what its published rigid model leaves, found in the measured runs."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from diagnosis.evidence import load_evidence
from diagnosis.gap import KNEE, Floor, differences, floor_of, gap, replicates
from diagnosis.library import trials
from diagnosis.nuisance import Nuisances
from diagnosis.problem import Problem, prepare
from diagnosis.refit import FAR_KNEE, Fitter
from diagnosis.search import refitted
from diagnosis.twin import Roughness

EMPS = Path(__file__).parents[3] / "shared" / "data" / "emps"
# friction, mass and viscous damping as published; what the paper does not give, as for a ball screw with seals
MANIFEST = """
format = "evidence/1"
[rig]
drive = "force"
mass_kg = 95.1
contact_stiffness_N_per_m = 2e6
contact_damping_Ns_per_m = 2.76e4
viscous_damping_Ns_per_m = 203.5
coulomb_force_N = 20.4
static_force_N = 22.4
stribeck_velocity_mps = 0.003
[rig.tolerance]
mass_kg = 0.03
contact_stiffness_N_per_m = 0.2
contact_damping_Ns_per_m = 0.2
viscous_damping_Ns_per_m = 0.1
coulomb_force_N = 0.1
static_force_N = 0.1
stribeck_velocity_mps = 0.2
[channels]
t_s = { column = "t" }
drive_force_N = { column = "vir", scale = 35.15 }
mass_position_m = { column = "qm" }
[[run]]
file = "DATA_EMPS.mat"
[[run]]
file = "DATA_EMPS_PULSES.mat"
holdout = true
"""


@pytest.mark.skipif(not EMPS.is_dir(), reason=f"needs the EMPS data set in {EMPS}")
def test_the_offset_that_a_rigid_model_without_one_leaves(tmp_path: Path) -> None:
    for name in ("DATA_EMPS.mat", "DATA_EMPS_PULSES.mat"):
        shutil.copyfile(EMPS / name, tmp_path / name)
    (tmp_path / "manifest.toml").write_text(MANIFEST)
    evidence = load_evidence(tmp_path)
    runs = prepare(evidence)
    nuisances = Nuisances(evidence.rig)
    point = nuisances.point(np.zeros(len(nuisances)), {})
    fitted, held_out = (Problem(evidence.rig, [run for run in runs if run.holdout == held]) for held in (False, True))

    def floor(problem: Problem) -> Floor:
        return floor_of(problem, point, replicates(problem, point, Roughness(0.003, 2e-4, 0), 12, 1))

    fitter, judge = Fitter(fitted, floor(fitted), nuisances), floor(held_out)
    retuned = fitter.retuned(np.zeros(len(nuisances)))
    described = fitter.described(np.zeros(len(nuisances)))
    offsets = [trial for trial in trials(fitted) if "force-sensor-bias" in trial.form.forms]
    with_bias = refitted(fitter, [(retuned, KNEE), (described, FAR_KNEE)], offsets)[0]
    gaps = [
        gap(judge, differences(judge, held_out, held_out.predicted(nuisances.point(fit.deviations, fit.effects))))
        for fit in (retuned, with_bias)
    ]
    assert with_bias.chi2 < retuned.chi2
    assert gaps[1] < gaps[0]
    assert -6.0 < float(with_bias.effects["force-sensor-bias"]["bias_N"]) < -2.0  # published: -3.16 N
