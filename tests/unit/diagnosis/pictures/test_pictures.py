"""The pictures of a diagnosis: few, small, labelled with units, and the residual belongs to the effect that was named."""

import numpy as np
import pytest

from diagnosis.gap.problem import Problem
from diagnosis.hypotheses.nuisances import Nuisances
from diagnosis.pictures.choice import pictures
from plant.effects.library import EFFECTS, checked
from tests.prepared import prepared

AGEING = {"static-friction-ageing": {"form": "log", "ratio": 0.04}}


@pytest.fixture(scope="module")
def aged():
    evidence, runs = prepared("ladder", AGEING)
    return Problem(evidence.rig, runs), Nuisances(evidence.rig)


def of(aged, effect):
    problem, nuisances = aged
    plain = nuisances.point(np.zeros(len(nuisances)), {})
    if effect is None:
        return pictures(problem, plain, plain, None, ())
    table = {effect: checked(effect, AGEING.get(effect, {}))}
    return pictures(problem, plain, plain, nuisances.point(np.zeros(len(nuisances)), table), (effect,))


@pytest.mark.slow
def test_every_run_has_its_cycle_and_the_effect_its_residual(aged):
    drawn = of(aged, "static-friction-ageing")
    cycles = [picture for picture in drawn if picture.kind == "cycle"]
    residuals = [picture for picture in drawn if picture.kind == "residual"]
    assert 4 <= len(cycles) <= 6
    for number in range(1, 5):
        assert any(picture.title.startswith(f"run-0{number}") for picture in cycles)
    first = cycles[0]
    assert [curve.style for curve in first.curves] == ["measured", "nominal", "retuned", "effect"]
    apart = {curve.style: np.abs(curve.y - first.curves[0].y).max() for curve in first.curves}
    assert apart["effect"] < 0.3 * apart["retuned"]
    assert residuals[0].x_label == "time at rest before the breakaway [s]"


@pytest.mark.slow
@pytest.mark.parametrize("effect", [None, *EFFECTS])
def test_any_verdict_can_be_drawn(aged, effect):
    problem, nuisances = aged
    drawn = of((Problem(problem.rig, problem.runs[1:3]), nuisances), effect)
    assert len(drawn) <= 10
    assert sum(picture.kind == "residual" for picture in drawn) in {2, 3}
    for picture in drawn:
        assert "[" in picture.x_label
        assert "[" in picture.y_label
        assert picture.title
        for curve in picture.curves:
            assert len(curve.x) == len(curve.y) <= 1500
            assert np.isfinite(curve.y).any() or len(curve.y) == 0


@pytest.mark.parametrize(
    ("protocol", "has"), [("force", ("drive_force_N", "mass_position_m")), ("slow", ("drive_force_N",))]
)
@pytest.mark.slow
def test_other_drives_and_fewer_channels(protocol, has):
    evidence, runs = prepared(protocol)
    runs = [run._replace(signals={name: run.signals[name] for name in has}) for run in runs]
    problem, nuisances = Problem(evidence.rig, runs), Nuisances(evidence.rig)
    assert of((problem, nuisances), None)
    assert of((problem, nuisances), "viscous-friction")
