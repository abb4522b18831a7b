"""A random load is recognised by its scatter, whatever its path."""

import copy
from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.evidence.folder import load_evidence
from diagnosis.fits import random_friction
from diagnosis.fits.random_friction import RANDOM_EFFECTS, RandomFriction, in_bursts
from diagnosis.fits.retuning import retuned_rig
from diagnosis.gap.measure import replicates
from diagnosis.gap.prepare import prepare
from diagnosis.gap.problem import Problem
from diagnosis.hypotheses.hypothesis import NOTHING
from diagnosis.verdict.held_out import HeldOut
from diagnosis.verdict.judge import JITTER
from tests.blind.generator import Case, draw_effect, make
from tests.prepared import prepared

pytestmark = pytest.mark.slow

RATIO = 0.03
LOAD = {"normal-load-fluctuation": {"form": "random", "ratio": RATIO, "frequency_Hz": 2.0, "seed": 5}}


@pytest.fixture(scope="module")
def rig():
    """A rig under a random load: its runs, and the refitted model without a load."""
    evidence, runs = prepared("short", LOAD)
    problem = Problem(evidence.rig, [run for run in runs if not run.holdout])
    unseen = Problem(evidence.rig, [run for run in runs if run.holdout])
    return retuned_rig(evidence, problem, lambda _message, _share: None), unseen


def test_a_random_load_pays_and_its_size_is_found(rig):
    (fitter, fit, roughness, expected_chi2), unseen = rig
    scattered = RandomFriction("normal-load-fluctuation", fitter, fit).on(fit, JITTER)
    assert scattered.gained > 30.0
    assert scattered.fit.chi2 < 1.5 * expected_chi2 < 0.7 * fit.chi2
    table = scattered.fit.effects["normal-load-fluctuation"]
    assert table["form"] == "random"
    assert RATIO / 2 < table["ratio"] < RATIO * 2
    # on other runs the load takes another path: their gap is compared with the scatter of such loads
    held_out = HeldOut(unseen, fitter.nuisances, scattered.fit, fit, roughness)
    closed = held_out.closed_by(scattered.fit)
    assert closed.shrinkage is not None
    assert closed.shrinkage > 0.5
    assert held_out.closed_by(fit).shrinkage == pytest.approx(0.0)


def gained_on(rig, effects):
    """Log evidence gained by each random effect on a rough and noisy run of the model with these effects."""
    (fitter, fit, roughness, _), _ = rig
    other = copy.copy(fitter.problem)
    other.measured = replicates(other, fitter.nuisances.point(fit.deviations, effects), roughness, 1, 9)[0]
    fitter = fitter.for_problem(other)
    fit = fitter.refit(NOTHING, fit.deviations, np.zeros(0))
    return {name: RandomFriction(name, fitter, fit).on(fit, JITTER).gained for name in RANDOM_EFFECTS}


def test_without_one_each_costs_more_than_it_brings(rig):
    assert max(gained_on(rig, {}).values()) < 0.0


def test_a_random_track_is_not_taken_for_a_random_load(rig):
    track = {"form": "random", "ratio": RATIO, "wavelength_m": 1.5e-3, "seed": 7}
    gained = gained_on(rig, {"position-dependent-friction": track})
    assert gained["position-dependent-friction"] > max(gained["normal-load-fluctuation"], 0.0) + 10.0


def rigs_in_bursts(folder, effect, formula, count):
    """How many of so many made rigs with an effect show bursts."""
    drawn = (draw_effect(np.random.default_rng(seed), effect) for seed in range(100))
    scattered = []
    for seed, one in enumerate([drawn_rig for drawn_rig in drawn if drawn_rig.formula.name == formula][:count]):
        make(folder / str(seed), Case((one,)), seed)
        evidence = load_evidence(folder / str(seed))
        scattered.append(in_bursts(Problem(evidence.rig, [run for run in prepare(evidence) if not run.holdout])))
    return sum(scattered)


def test_a_continuous_load_shows_no_bursts(rig):
    (fitter, _, _, _), _ = rig
    assert not in_bursts(fitter.problem)


def test_bursts_are_one_sided_or_rare_and_a_continuous_load_is_neither(monkeypatch):
    """Three series of 200 breakaways: with a few strong bursts, with rare bursts of both signs, and smooth."""
    drawn = np.random.default_rng(4)
    even = np.sin(np.linspace(0.0, 60.0, 200))
    debris = np.where(drawn.random(200) < 0.1, 1.0, 0.0) + 0.05 * even
    rare = np.where(drawn.random(200) < 0.1, drawn.normal(size=200), 0.1 * drawn.normal(size=200))

    def of(values):
        series = [SimpleNamespace(value=values - values.mean(), of_slips=True)]
        monkeypatch.setattr(random_friction, "friction_series", lambda *_: series)
        return in_bursts(SimpleNamespace(runs=[], scales=None))

    assert [of(debris), of(rare), of(even)] == [True, True, False]
    assert of(even[:6])  # too few values to decide


@pytest.mark.nightly  # 15 s of CPU
def test_bursts_of_one_rig_are_separated_from_a_continuous_load(tmp_path):
    assert rigs_in_bursts(tmp_path / "debris", "debris-bursts", "gaussian", 1) == 1
    assert rigs_in_bursts(tmp_path / "load", "normal-load-fluctuation", "narrow-band", 1) == 0


@pytest.mark.nightly
def test_bursts_are_not_taken_for_a_continuous_load(tmp_path):
    """Of 12 rigs each, 11 and 3 show bursts; that count takes a minute."""
    assert rigs_in_bursts(tmp_path / "debris", "debris-bursts", "gaussian", 4) == 4
    assert rigs_in_bursts(tmp_path / "load", "normal-load-fluctuation", "narrow-band", 4) <= 1
