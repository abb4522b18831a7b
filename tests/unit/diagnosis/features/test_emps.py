"""The public EMPS ball-screw axis: known misfits of its published rigid model are found in the measured runs."""

from pathlib import Path

import numpy as np
import pytest

from diagnosis.evidence.folder import load_evidence
from diagnosis.fits.baseline import Baseline
from diagnosis.fits.batch import together
from diagnosis.fits.explanations import Search
from diagnosis.fits.gauss_newton import Fitter
from diagnosis.gap.measure import Floor, differences, floor_of, gap, replicates
from diagnosis.gap.prepare import prepare
from diagnosis.gap.problem import Problem
from diagnosis.hypotheses.catalogue import trials
from diagnosis.hypotheses.nuisances import Nuisances
from diagnosis.model.rig import Roughness
from tests.real.evidences import AXIS, MISSING, axis

pytestmark = pytest.mark.slow
SURFACE = Roughness(0.003, 2e-4, 0)


@pytest.mark.skipif(not AXIS.is_dir(), reason=MISSING)
def test_the_offset_that_a_rigid_model_without_one_leaves(tmp_path: Path) -> None:
    axis(tmp_path)
    evidence = load_evidence(tmp_path)
    runs = prepare(evidence)
    nuisances = Nuisances(evidence.rig)
    point = nuisances.point(np.zeros(len(nuisances)), {})
    fitted, held_out = (Problem(evidence.rig, [run for run in runs if run.holdout == held]) for held in (False, True))

    def floor(problem: Problem) -> Floor:
        return floor_of(problem, point, replicates(problem, point, SURFACE, 12, 1))

    fitter, judge = Fitter(fitted, floor(fitted), nuisances), floor(held_out)
    retuned = together(fitter.predicted_many, [fitter.retuning(np.zeros(len(nuisances)))])[0]
    offsets = [trial for trial in trials(fitted) if "force-sensor-bias" in trial.hypothesis.forms]
    search = Search(Baseline(fitter, retuned, SURFACE), offsets, lambda _: 0.0)
    search.run(frozenset(), lambda *_: None)
    with_bias = search.of(frozenset(("force-sensor-bias",)))
    assert with_bias is not None
    gaps = [
        gap(judge, differences(judge, held_out, held_out.predicted(nuisances.point(fit.deviations, fit.effects))))
        for fit in (retuned, with_bias)
    ]
    assert with_bias.chi2 < retuned.chi2
    assert gaps[1] < gaps[0]
    assert -6.0 < float(with_bias.effects["force-sensor-bias"]["bias_N"]) < -2.0  # published: -3.16 N
