"""A name of little evidence is checked, and a rejected name is replaced by the next."""

import numpy as np
import pytest

from diagnosis.fits.fit import Fit
from diagnosis.fits.retuning import ROUGHNESS, Retuned
from diagnosis.verdict import selection
from diagnosis.verdict.judge import judge
from tests.unit.diagnosis.verdict.test_judge import EXPECTED, fit

BASE = 160.0


@pytest.fixture
def ranked() -> list[Fit]:
    return [fit(80.0, "coulomb-level"), fit(84.0, "drive-backlash"), fit(130.0, "static-level")]


def checked(monkeypatch, ranked: list[Fit], middles: dict[str, float]):
    """The verdict after the check, where the middle fit of an effect leaves `middles` and the rig without effects `BASE`."""
    asked: list[str] = []

    def middle_fits(_fitter, none, _singles, named, _jobs):
        (name,) = named.hypothesis.effects
        asked.append(name)
        return none, fit(middles[name], name)

    monkeypatch.setattr(selection, "middle_fits", middle_fits)
    rig = Retuned(np.nan, fit(BASE), ROUGHNESS, EXPECTED)
    singles, verdict = selection.checked(rig, ranked, [], judge(rig.fit, ranked, [], EXPECTED), 1)
    return asked, singles, verdict


def test_a_confirmed_name_stays(monkeypatch, ranked):
    asked, singles, verdict = checked(monkeypatch, ranked, {"coulomb-level": 82.0})
    assert asked == ["coulomb-level"]
    assert verdict.named.hypothesis.effects == ("coulomb-level",)
    assert singles == ranked


def test_the_next_effect_is_named_where_the_first_is_rejected(monkeypatch, ranked):
    asked, singles, verdict = checked(monkeypatch, ranked, {"coulomb-level": 158.0, "drive-backlash": 86.0})
    assert asked == ["coulomb-level", "drive-backlash"]
    assert verdict.named.hypothesis.effects == ("drive-backlash",)
    assert [fit.chi2 for fit in singles] == [84.0, 130.0, 158.0]
    assert verdict.probabilities["static-level"] > 0.0


def test_nothing_is_named_where_all_effects_are_rejected(monkeypatch, ranked):
    asked, _, verdict = checked(monkeypatch, ranked, {"coulomb-level": 158.0, "drive-backlash": 159.0})
    assert asked == ["coulomb-level", "drive-backlash"]
    assert verdict.named is None


def test_the_held_out_runs_refute_only_the_checked_name(monkeypatch):
    """A pair that does not beat the rejected name would beat the next name."""
    middles = {("coulomb-level",): fit(124.0, "coulomb-level"), ("drive-backlash",): fit(67.0, "drive-backlash")}
    monkeypatch.setattr(
        selection,
        "middle_fits",
        lambda _fitter, none, _singles, named, _jobs: (none, middles[named.hypothesis.effects]),
    )
    monkeypatch.setattr(selection, "screened", lambda *_: [])
    monkeypatch.setattr(selection.Contest, "_leaves_much", lambda *_: False)
    made = selection.Contest(Retuned(np.nan, fit(125.0), ROUGHNESS, EXPECTED), [], 1)
    made.singles = [fit(60.0, "coulomb-level"), fit(65.0, "drive-backlash")]
    made.pairs = [fit(10.0, "coulomb-level", "static-level")]
    made.verdict = judge(fit(125.0), made.singles, made.pairs, EXPECTED)
    assert made.verdict.named.hypothesis.effects == ("coulomb-level",)
    made.check()
    assert made.verdict.named.hypothesis.effects == ("drive-backlash",)
    assert made.refuted().refuted == ("drive-backlash",)
