"""Confirmation by held-out runs: fake runs with a given misfit, and verdicts over made-up fits."""

from types import SimpleNamespace
from typing import Any

import pytest

from diagnosis.fits.fit import Fit
from diagnosis.hypotheses.hypothesis import Hypothesis
from diagnosis.verdict import confirmation
from diagnosis.verdict.confirmation import Confirmation, borne_out
from diagnosis.verdict.judge import judge
from tests.unit.diagnosis.verdict.test_judge import EXPECTED, TRACK, fit

GAP = 400.0


def random(chi2: float) -> Fit:
    at_random = fit(chi2, TRACK)
    return at_random._replace(hypothesis=Hypothesis({TRACK: "random"}, at_random.hypothesis.coordinates))


def outcome(
    monkeypatch: pytest.MonkeyPatch,
    named: Fit,
    elsewhere: Fit | None = None,
    retuned: float = 3.0,
    left: float = 1.0,
    refuted: tuple[Fit, ...] = (),
) -> Confirmation:
    """Where `named` wins the contest, in floors of the held-out runs, which refute some fits."""
    base = fit(GAP)

    def verdict(*fits: Fit, **more: Any):
        return judge(base, list(fits), [], EXPECTED, **more)

    contest: Any = SimpleNamespace(
        rig=SimpleNamespace(fitter=SimpleNamespace(nuisances=None), fit=base, expected_chi2=EXPECTED, roughness=None),
        verdict=verdict(named),
        refuted=lambda: verdict(named, refuted=True),
        elsewhere=lambda: None if elsewhere is None else verdict(elsewhere),
        without_random=lambda: judge(fit(EXPECTED), [], [], EXPECTED),
    )

    def held_out(_problem, _nuisances, best, *_):
        return SimpleNamespace(
            best=best,
            retuned=retuned,
            refutes=lambda fit, _expected: any(fit is one for one in refuted),
            left_by=lambda _fit: left,
        )

    monkeypatch.setattr(confirmation, "HeldOut", held_out)
    unseen: Any = object()
    return borne_out(contest, unseen, jobs=1)


def test_a_name_that_they_bear_out_stays(monkeypatch):
    named = fit(50.0, "static-level")
    confirmed = outcome(monkeypatch, named)
    assert (confirmed.verdict.kind, confirmed.best, confirmed.gone) == ("effect", named, None)


def test_a_name_that_leaves_more_than_right_ones_is_less_sure(monkeypatch):
    named = fit(50.0, "static-level")
    sure, doubtful = (outcome(monkeypatch, named, left=left).verdict for left in (1.0, 2.5))
    assert doubtful.named is named
    assert doubtful.probabilities["static-level"] < sure.probabilities["static-level"] - 0.2


def test_a_name_that_they_refute_goes(monkeypatch):
    named = fit(50.0, "static-level")
    confirmed = outcome(monkeypatch, named, refuted=(named,))
    assert (confirmed.verdict.kind, confirmed.verdict.refuted) == ("unexplained", ("static-level",))
    assert confirmed.gone is named
    assert confirmed.best.hypothesis.effects == ()


def test_waves_of_a_track_that_another_place_refutes_make_room_for_a_path_at_random(monkeypatch):
    waves, path = fit(50.0, TRACK), random(60.0)
    confirmed = outcome(monkeypatch, waves, elsewhere=path, refuted=(waves,))
    assert (confirmed.verdict.kind, confirmed.best, confirmed.gone) == ("effect", path, None)
    assert confirmed.held_out is not None
    assert confirmed.held_out.best is path
    neither = outcome(monkeypatch, waves, elsewhere=path, refuted=(waves, path))
    assert (neither.verdict.kind, neither.gone) == ("unexplained", waves)


def test_a_random_path_without_scatter_in_the_held_out_runs_becomes_no_gap(monkeypatch):
    path = random(50.0)
    assert outcome(monkeypatch, path, retuned=1.1).best is path
    confirmed = outcome(monkeypatch, path, retuned=0.97)
    assert (confirmed.verdict.kind, confirmed.gone) == ("no-gap", None)
    assert confirmed.best.hypothesis.effects == ()


def test_another_effect_may_not_show_there(monkeypatch):
    named = fit(50.0, "drive-damping")
    assert outcome(monkeypatch, named, retuned=0.97).best is named
