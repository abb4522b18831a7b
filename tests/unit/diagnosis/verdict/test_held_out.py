"""Names that a held-out run may refute: only effects that predict its course."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from diagnosis.gap.measure import Floor
from diagnosis.hypotheses.hypothesis import Coordinate, Hypothesis
from diagnosis.verdict import held_out as heldout
from diagnosis.verdict.held_out import HeldOut, foretells


def form(name: str, form: str, *parameters: str) -> Hypothesis:
    return Hypothesis(
        {name: form}, tuple(Coordinate(name, parameter, 0.1, False, 1.0, -1.0, 1.0) for parameter in parameters)
    )


WAVE = ("ratio", "phase_rad", "second_sin", "second_cos")
FORETELLS = [
    (form("static-level", "", "ratio"), True),
    (form("position-dependent-friction", "wave", "wavelength_m", *WAVE), True),  # the track is the same
    (form("drive-speed-ripple", "screw", "wavelength_m", *WAVE), True),
    (form("base-compliance", "", "compliance_m_per_N", "frequency_Hz"), True),
    (form("normal-load-fluctuation", "sine", "frequency_Hz", *WAVE), False),
    (form("drive-speed-ripple", "time", "frequency_Hz", *WAVE), False),
    (form("position-dependent-friction", "random", "ratio", "wavelength_m"), False),
]


def stand_in(
    retuned: float,
    left: float,
    gap: float = 1.0,
    scattered: float = 1.0,
    shows: bool = True,
    left_open: float | None = None,
) -> Any:
    """Held-out runs of 100 features: `retuned` and `left` are chi2 of the course; `gap` and `scattered` are in floors."""
    runs = SimpleNamespace(
        _too_much=lambda left, expected: HeldOut._too_much(runs, left, expected),
        _left_open=lambda _fit, _residual: left if left_open is None else left_open,
        _left_retuned=np.array([retuned**0.5, 0.0]),
        _left=lambda _fit: np.array([0.0, left**0.5]) if shows else np.array([retuned**0.5, 0.0]),
        floor=SimpleNamespace(whitening=range(100)),
        retuned=gap,
        left_by=lambda _fit: scattered,
    )
    return runs


def fit_of(hypothesis: Hypothesis) -> Any:
    return SimpleNamespace(hypothesis=hypothesis, deviations=None, w=None)


def both(first: Hypothesis, second: Hypothesis) -> Hypothesis:
    return Hypothesis(first.forms | second.forms, (*first.coordinates, *second.coordinates))


def test_the_axes_of_two_effects_are_not_one_wave():
    """A wave along the track has a phase and a base a frequency: neither turns over time."""
    track, base, load = FORETELLS[1][0], FORETELLS[3][0], FORETELLS[4][0]
    assert foretells(both(track, base))
    assert not foretells(both(load, base))


def test_a_random_effect_is_measured_by_its_wider_floor():
    """A cell that differs by the level of its floor, 1 or 2, is 1 floor off with either floor."""
    ones = np.ones(1)
    narrow = Floor(0 * ones, ones < 0, ones, ones > 0, np.eye(1), (("force", "stick", (0.0, 20.0), "a"),), 1.0)
    held_out = HeldOut.__new__(HeldOut)
    held_out.floor, held_out._wider = narrow, narrow._replace(level=2.0)
    held_out._differences = lambda floor, _form, at: [np.array([floor.level])] * len(at)  # pyright: ignore[reportAttributeAccessIssue]
    plain, random = FORETELLS[0][0], FORETELLS[6][0]
    (exactly,) = held_out._squares(plain, [(ones, np.zeros(1))])
    assert held_out._squares(random, [(ones, np.zeros(2))])[0] == pytest.approx(exactly, rel=0.1)


@pytest.mark.parametrize(("effect", "does"), FORETELLS)
def test_an_effect_that_predicts_nothing_of_another_run_is_not_refuted_by_its_course(effect, does):
    """Held-out runs whose course the fit does not explain at all, and whose scatter it explains fully."""
    held_out = stand_in(500.0, 500.0, gap=5.0, scattered=1.0)
    assert foretells(effect) is does
    assert HeldOut.refutes(held_out, fit_of(effect), 0.4) is does


@pytest.mark.parametrize(
    ("gap", "left", "refuted"),
    [
        (8.8, 5.3, True),  # a tilted track taken for a load
        (9.5, 1.9, False),
        (1.5, 1.4, False),  # the misfit is within the range of a right effect
        (8.8, 3.5, False),  # much is left, and most is closed
    ],
)
def test_an_effect_that_leaves_most_scatter_of_another_run_is_refuted(gap, left, refuted):
    load = FORETELLS[4][0]
    assert HeldOut.refutes(stand_in(500.0, 500.0, gap, left), fit_of(load), 0.4) is refuted


@pytest.mark.parametrize(
    ("retuned", "left", "refuted"),
    [
        (100.0, 95.0, True),  # a small misfit, of which 5 % is closed
        (100.0, 75.0, False),  # a small misfit, of which 25 % is closed
        (2000.0, 1000.0, True),  # half is closed, and the rest is 25 times the misfit of a right model
        (2000.0, 500.0, False),  # much is left, and most is closed
        (340.0, 172.0, False),  # little is left
    ],
)
def test_an_effect_that_another_run_does_not_confirm_is_refuted(retuned, left, refuted):
    assert HeldOut.refutes(stand_in(retuned, left), fit_of(FORETELLS[0][0]), 0.4) is refuted


def test_an_effect_that_does_not_show_in_another_run_is_not_refuted_by_it():
    hidden = stand_in(2000.0, 0.0, shows=False)  # backlash, where nothing reverses
    assert not HeldOut.refutes(hidden, fit_of(FORETELLS[0][0]), 0.4)


def test_without_compared_features_the_shrinkage_is_unknown():
    held_out = HeldOut.__new__(HeldOut)
    held_out.retuned = HeldOut._gap(np.zeros(0))
    closed = held_out._closed(np.zeros(0), [np.zeros(0)])
    assert math.isnan(closed.gap)
    assert closed.shrinkage is closed.interval_90 is None


@pytest.mark.parametrize(
    ("left", "left_open", "refuted"), [(298.0, 84.0, False), (255.0, 250.0, True), (100.0, 300.0, False)]
)
def test_undetermined_parameters_may_differ_in_the_held_out_runs(left, left_open, refuted):
    """An ageing of undetermined scale; a seal misnamed as a static level; a name that fits without moved parameters."""
    held_out = stand_in(255.0, left, left_open=left_open)
    assert HeldOut.refutes(held_out, fit_of(FORETELLS[0][0]), 0.4) is refuted


def test_the_open_misfit_is_the_least_over_parameters_within_their_covariance(monkeypatch):
    """A linear problem: equal to least squares with the covariance of the parameters as a prior."""
    random = np.random.default_rng(1)
    rates, residual = random.normal(size=(30, 4)), random.normal(size=30)
    covariance = np.cov(random.normal(size=(4, 9)))
    at = random.normal(size=4)
    monkeypatch.setattr(heldout, "whitened", lambda _floor, _problem, predicted: (predicted,))
    held_out: Any = HeldOut.__new__(HeldOut)
    held_out.floor = None
    held_out._nuisances = SimpleNamespace(point=lambda deviations, tables: np.concatenate([deviations, tables]))
    held_out.problem = SimpleNamespace(
        predicted_many=lambda points: [residual + rates @ (point - at) for point in points]
    )
    fit = SimpleNamespace(
        deviations=at[:3], w=at[3:], hypothesis=SimpleNamespace(tables=lambda w: w), covariance=lambda: covariance
    )
    spread = np.linalg.cholesky(covariance)
    whole = np.vstack([rates @ spread, np.eye(4)])
    least = np.linalg.lstsq(whole, np.concatenate([residual, np.zeros(4)]))[1][0]
    assert held_out._left_open(fit, residual) == pytest.approx(least, rel=1e-6)
    assert least < residual @ residual
