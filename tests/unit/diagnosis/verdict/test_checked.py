"""A name of little evidence is checked, and one that falls makes room for the next one."""

import numpy as np
import pytest

from diagnosis.fits.fit import Fit
from diagnosis.fits.retuning import ROUGHNESS, Retuned
from diagnosis.verdict import selection
from diagnosis.verdict.judge import judge
from tests.unit.diagnosis.verdict.test_judge import EXPECTED, fit

BASE = 160.0


@pytest.fixture
def found() -> list[Fit]:
    return [fit(80.0, "coulomb-level"), fit(84.0, "drive-backlash"), fit(130.0, "static-level")]


def checked(monkeypatch, found: list[Fit], middles: dict[str, float]):
    """What is left of the verdict where an effect's middle fit leaves this, and the rig without one `BASE`."""
    asked: list[str] = []

    def middle_fits(_fitter, none, _singles, named, _jobs):
        (name,) = named.hypothesis.effects
        asked.append(name)
        return none, fit(middles[name], name)

    monkeypatch.setattr(selection, "middle_fits", middle_fits)
    rig = Retuned(np.nan, fit(BASE), ROUGHNESS, EXPECTED)
    singles, verdict = selection.checked(rig, found, [], judge(rig.fit, found, [], EXPECTED), 1)
    return asked, singles, verdict


def test_a_name_that_stands_stays(monkeypatch, found):
    asked, singles, verdict = checked(monkeypatch, found, {"coulomb-level": 82.0})
    assert asked == ["coulomb-level"]
    assert verdict.named.hypothesis.effects == ("coulomb-level",)
    assert singles == found


def test_the_next_one_is_named_where_the_first_falls(monkeypatch, found):
    asked, singles, verdict = checked(monkeypatch, found, {"coulomb-level": 158.0, "drive-backlash": 86.0})
    assert asked == ["coulomb-level", "drive-backlash"]
    assert verdict.named.hypothesis.effects == ("drive-backlash",)
    assert [one.chi2 for one in singles] == [84.0, 130.0, 158.0]
    assert verdict.probabilities["static-level"] > 0.0


def test_where_all_fall_nothing_is_named(monkeypatch, found):
    asked, _, verdict = checked(monkeypatch, found, {"coulomb-level": 158.0, "drive-backlash": 159.0})
    assert asked == ["coulomb-level", "drive-backlash"]
    assert verdict.named is None


def test_what_the_held_out_runs_refute_is_what_they_were_asked_about(monkeypatch):
    """Two effects that did not pay beside the name that fell would pay beside the next one."""
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
