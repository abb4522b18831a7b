"""The verdict over made-up fits of 100 compared features; the chi2 of a right model is 20 to 60."""

import numpy as np
import pytest

from diagnosis.diagnose import with_vibration_findings
from diagnosis.evidence.folder import MeasuredRun
from diagnosis.evidence.foreign_vibration import DISTORTED, PICK_UP, ForeignVibration
from diagnosis.fits.fit import Fit
from diagnosis.fits.random_friction import Scattered, is_random
from diagnosis.hypotheses.hypothesis import NOTHING, Coordinate, Hypothesis
from diagnosis.report.assemble import compared_fits
from diagnosis.verdict.judge import JITTER, doubted, is_of_one_place, judge, of_another_place, with_outside

FEATURES = 100
NUISANCES = 2
EXPECTED = 40.0  # chi2 of a perfect model
TRACK = "position-dependent-friction"


def fit(chi2, *effects):
    form = Hypothesis(
        dict.fromkeys(effects, ""), tuple(Coordinate(name, "ratio", 0.1, False, 1.0, -1.0, 1.0) for name in effects)
    )
    columns = np.eye(FEATURES, NUISANCES + len(effects)) * 10.0
    residual = np.full(FEATURES, (chi2 / FEATURES) ** 0.5)
    return Fit(form if effects else NOTHING, np.zeros(NUISANCES), np.zeros(len(effects)), chi2, residual, columns)


def test_a_good_fit_without_effects_gives_no_gap():
    assert judge(fit(50.0), [fit(48.0, "coulomb-level")], [], EXPECTED).kind == "no-gap"


def test_a_gap_for_which_no_effect_was_fitted_in_time_is_no_verdict_that_nothing_is_wrong():
    verdict = judge(fit(400.0), [], [], EXPECTED)
    assert (verdict.kind, verdict.named, verdict.runner_up) == ("unexplained", None, None)
    assert next(iter(verdict.probabilities)) == "unexplained"
    assert judge(fit(50.0), [], [], EXPECTED).kind == "no-gap"


def test_an_effect_that_explains_most_is_named():
    verdict = judge(fit(400.0), [fit(50.0, "coulomb-level"), fit(380.0, "static-level")], [], EXPECTED)
    assert verdict.kind == "effect"
    assert verdict.named is not None
    assert verdict.named.hypothesis.effects == ("coulomb-level",)
    assert sum(verdict.probabilities.values()) == pytest.approx(1.0)


def test_an_outside_finding_turns_only_no_gap_into_unexplained():
    nothing = judge(fit(50.0), [fit(48.0, "coulomb-level")], [], EXPECTED)
    outside = with_outside(nothing)
    assert (outside.kind, outside.outside) == ("unexplained", True)
    assert next(iter(outside.probabilities)) == "unexplained"
    assert sum(outside.probabilities.values()) == pytest.approx(1.0)
    effect = judge(fit(400.0), [fit(50.0, "coulomb-level")], [], EXPECTED)
    assert with_outside(effect) == effect


def test_an_outside_finding_withdraws_the_name_of_an_effect_that_imitates_it():
    effect = judge(fit(400.0), [fit(50.0, "piezo-resonance")], [], EXPECTED)
    assert with_outside(effect, frozenset({"piezo-sag"})) == effect
    outside = with_outside(effect, frozenset({"piezo-sag", "piezo-resonance"}))
    assert (outside.kind, outside.named, outside.runner_up) == ("unexplained", None, effect.named)
    assert outside.probabilities["unexplained"] == effect.probabilities["piezo-resonance"]
    assert sum(outside.probabilities.values()) == pytest.approx(1.0)


def test_harmonics_withdraw_a_piezo_effect_and_a_pick_up_withdraws_none():
    plain = MeasuredRun("run-01.csv", np.zeros(2), {}, {}, None, False)
    picked_up = plain._replace(foreign=(ForeignVibration(3.0, PICK_UP, "drive_force_N", 2500.0, ""),))
    distorted = plain._replace(foreign=(ForeignVibration(2.0, DISTORTED, "base_accel_mps2", 5000.0, ""),))
    effect = judge(fit(400.0), [fit(50.0, "piezo-resonance")], [], EXPECTED)
    assert with_vibration_findings(effect, [plain, picked_up]).kind == "effect"
    assert with_vibration_findings(effect, [plain, distorted]).kind == "unexplained"
    other = judge(fit(400.0), [fit(50.0, "coulomb-level")], [], EXPECTED)
    assert with_vibration_findings(other, [distorted]).kind == "effect"
    nothing = judge(fit(50.0), [fit(48.0, "coulomb-level")], [], EXPECTED)
    assert with_vibration_findings(nothing, [plain]).kind == "no-gap"
    assert (
        with_vibration_findings(nothing, [picked_up]).kind
        == with_vibration_findings(nothing, [distorted]).kind
        == "unexplained"
    )


def test_a_gap_that_no_effect_explains_is_unexplained():
    assert judge(fit(4000.0), [fit(3900.0, "coulomb-level")], [], EXPECTED).kind == "unexplained"


@pytest.mark.parametrize(
    ("base", "left", "kind"),
    [
        (400.0, 75.0, "effect"),
        (400.0, 200.0, "unexplained"),
        (4000.0, 145.0, "effect"),
        (4000.0, 500.0, "effect"),  # a tenth of the gap, as another formula of the same effect leaves
        (4000.0, 1500.0, "unexplained"),
    ],
)
def test_an_effect_that_leaves_more_than_a_right_effect_is_unexplained(base, left, kind):
    assert judge(fit(base), [fit(left, "coulomb-level")], [], EXPECTED).kind == kind


@pytest.mark.parametrize(("left", "kind"), [(145.0, "effect"), (500.0, "unexplained")])
def test_a_gain_has_no_other_formula_that_would_leave_much(left, kind):
    assert judge(fit(4000.0), [fit(left, "force-sensor-gain")], [], EXPECTED).kind == kind


def test_two_effects_must_leave_less_than_one():
    single, double = fit(3000.0, "coulomb-level"), fit(600.0, "coulomb-level", "drive-backlash")
    assert judge(fit(4000.0), [single], [double], EXPECTED).kind == "unexplained"


def test_a_name_that_the_held_out_runs_refute_becomes_unexplained():
    named = fit(50.0, "coulomb-level")
    verdict = judge(fit(400.0), [named], [], EXPECTED, refuted=True)
    assert (verdict.kind, verdict.named, verdict.refuted) == ("unexplained", None, ("coulomb-level",))
    assert verdict.runner_up is named
    assert next(iter(verdict.probabilities)) == "unexplained"


@pytest.mark.parametrize(("expected", "kind"), [(40.0, "effect"), (50.0, "unexplained")])
def test_where_noise_hides_the_slips_an_effect_must_leave_nothing(expected, kind):
    assert judge(fit(1000.0), [fit(90.0, "coulomb-level")], [], expected).kind == kind
    assert judge(fit(1000.0), [fit(50.0, "coulomb-level")], [], expected).kind == "effect"


@pytest.mark.parametrize(
    ("base", "single", "double", "named"),
    [
        (1000.0, 400.0, 50.0, 2),  # the second effect closes the rest of the first
        (1000.0, 90.0, 80.0, 1),  # the second closes little of the rest
        (20000.0, 59.0, 45.0, 1),  # the first leaves no gap
        (
            20000.0,
            300.0,
            50.0,
            2,
        ),  # the first leaves a gap that the second closes, although it is small compared with the whole gap
        (20000.0, 600.0, 200.0, 1),  # neither closes the rest: another formula of the first effect would leave as much
        (7200.0, 80.0, 55.0, 1),  # as above with a smaller rest
        (3000.0, 50.0, 20.0, 1),  # the first alone leaves the chi2 of evidence without a gap
    ],
)
def test_a_second_effect_must_pay(base, single, double, named):
    pairs = [fit(double, "coulomb-level", "drive-backlash")]
    verdict = judge(fit(base), [fit(single, "coulomb-level")], pairs, EXPECTED)
    assert verdict.named is not None
    assert len(verdict.named.hypothesis.effects) == named


def test_a_small_second_effect_is_named_where_the_first_has_no_other_formula():
    pair = [fit(80.0, "force-sensor-gain", "drive-hardening")]
    verdict = judge(fit(7200.0), [fit(200.0, "force-sensor-gain")], pair, EXPECTED)
    assert verdict.named is pair[0]
    elsewhere = [fit(80.0, "coulomb-level", "drive-hardening")]
    named = judge(fit(7200.0), [fit(200.0, "coulomb-level")], elsewhere, EXPECTED).named
    assert named is not None
    assert named.hypothesis.effects == ("coulomb-level",)


def test_no_gap_keeps_a_probability_for_effects_too_small_to_see():
    probabilities = judge(fit(50.0), [fit(48.0, "coulomb-level")], [], EXPECTED).probabilities
    assert sum(probabilities.values()) == pytest.approx(1.0)
    assert next(iter(probabilities)) == "none"
    assert probabilities["none"] == pytest.approx(0.71, abs=0.03)
    assert probabilities["unexplained"] == pytest.approx(0.12, abs=0.02)
    assert probabilities["drive-backlash"] == pytest.approx(0.0065, abs=0.002)


def test_no_verdict_is_more_certain_than_its_counted_rate():
    named = judge(fit(4000.0), [fit(50.0, "coulomb-level")], [], EXPECTED).probabilities
    assert named["coulomb-level"] == pytest.approx(0.98, abs=0.005)
    assert named["unexplained"] == pytest.approx(0.01, abs=0.005)
    pair = judge(fit(4000.0), [fit(900.0, "coulomb-level")], [fit(50.0, "coulomb-level", "drive-backlash")], EXPECTED)
    both = {name: pair.probabilities[name] for name in ("coulomb-level", "drive-backlash")}
    assert list(pair.probabilities)[:2] == list(both)
    assert sum(both.values()) == pytest.approx(0.75, abs=0.01)
    left = judge(fit(40000.0), [fit(39000.0, "coulomb-level")], [], EXPECTED).probabilities
    assert left["unexplained"] == pytest.approx(0.80, abs=0.01)
    for probabilities in (named, pair.probabilities, left):
        assert sum(probabilities.values()) == pytest.approx(1.0)


def test_a_name_that_leaves_much_of_the_held_out_runs_is_less_certain():
    pairs = [fit(50.0, "coulomb-level", "drive-backlash")]
    for verdict in (
        judge(fit(4000.0), [fit(50.0, "coulomb-level")], [], EXPECTED),
        judge(fit(4000.0), [fit(900.0, "coulomb-level")], pairs, EXPECTED),
    ):
        assert verdict.named is not None
        names, less_sure = verdict.named.hypothesis.effects, doubted(verdict)
        assert less_sure.named is verdict.named
        assert tuple(sorted(list(less_sure.probabilities)[: len(names)])) == tuple(sorted(names))
        sure, less = (sum(outcome.probabilities[name] for name in names) for outcome in (verdict, less_sure))
        assert 0.55 * sure < less < 0.7 * sure
        assert 0.2 < less_sure.probabilities["unexplained"] < 0.3
        assert sum(less_sure.probabilities.values()) == pytest.approx(1.0)


def test_no_gap_stays_the_likeliest_where_it_is_the_verdict():
    verdict = judge(fit(60.0), [fit(30.0, "coulomb-level")], [], EXPECTED)
    assert verdict.kind == "no-gap"
    assert list(verdict.probabilities)[:2] == ["none", "coulomb-level"]
    assert verdict.probabilities["coulomb-level"] > 0.1


class Scatter:
    """Fake of a random effect: chi2 that it leaves in addition to a fit, and its log evidence."""

    def __init__(self, left, gained, more=0.0, effect="normal-load-fluctuation", in_bursts=False):
        self.left, self.gained, self.more, self.effect, self.in_bursts = left, gained, more, effect, in_bursts

    def on(self, under, noise):
        form = Hypothesis(under.hypothesis.forms | {self.effect: "random"}, under.hypothesis.coordinates)
        left = self.left + self.more * (noise - JITTER)  # more noise leaves a shorter path
        return Scattered(under._replace(hypothesis=form, chi2=left), self.gained)


@pytest.mark.parametrize(
    ("single", "left", "gained", "kind", "effects"),
    [
        (900.0, 50.0, 100.0, "effect", [TRACK]),
        (900.0, 50.0, 5.0, "unexplained", []),  # its gain does not pay for its freedom
        (900.0, 500.0, 100.0, "unexplained", []),  # much is left that such scatter does not explain
        (400.0, 50.0, 90.0, "effect", ["coulomb-level", TRACK]),  # both
        (45.0, 40.0, 90.0, "effect", ["coulomb-level"]),  # the first effect leaves no gap
        (
            70.0,
            48.0,
            90.0,
            "effect",
            ["coulomb-level"],
        ),  # the small rest may belong to another formula of the first effect
    ],
)
def test_friction_that_scatters_must_pay_for_its_path(single, left, gained, kind, effects):
    scatter = Scatter(left, gained, effect=TRACK)
    verdict = judge(fit(1000.0), [fit(single, "coulomb-level")], [], EXPECTED, [scatter])
    assert verdict.kind == kind
    assert sorted(verdict.named.hypothesis.effects if verdict.named else []) == effects


def test_a_refuted_random_effect_is_compared_on_the_held_out_runs_too():
    singles, scatter = [fit(900.0, "coulomb-level")], [Scatter(50.0, 100.0, effect=TRACK)]
    gone = judge(fit(1000.0), singles, [], EXPECTED, scatter).named
    verdict = judge(fit(1000.0), singles, [], EXPECTED, scatter, refuted=True)
    assert verdict.refuted == (TRACK,)
    assert [fit.hypothesis.effects for fit in compared_fits(verdict, gone)] == [(TRACK,), ("coulomb-level",)]
    named = judge(fit(400.0), [fit(50.0, "coulomb-level")], [], EXPECTED).named
    refuted = judge(fit(400.0), [fit(50.0, "coulomb-level")], [], EXPECTED, refuted=True)
    assert [fit.hypothesis.effects for fit in compared_fits(refuted, named)] == [("coulomb-level",)]


def test_a_load_in_bursts_stays_unexplained():
    load, singles = "normal-load-fluctuation", [fit(900.0, "coulomb-level")]
    verdict = judge(fit(1000.0), singles, [], EXPECTED, [Scatter(50.0, 100.0, in_bursts=True)])
    assert (verdict.kind, verdict.named, verdict.refuted) == ("unexplained", None, ())
    assert list(verdict.probabilities)[:2] == ["unexplained", load]
    assert 0.2 < verdict.probabilities[load] < 0.4
    steady = judge(fit(1000.0), singles, [], EXPECTED, [Scatter(50.0, 100.0)])
    assert steady.named is not None
    assert steady.named.hypothesis.effects == (load,)
    assert 0.2 < steady.probabilities["unexplained"] < 0.4


def test_waves_that_another_place_refutes_may_be_a_track_at_random():
    waves, scatter = fit(60.0, TRACK), [Scatter(50.0, 100.0, effect=TRACK)]
    base, other = fit(1000.0), fit(900.0, "coulomb-level")
    verdict = of_another_place(base, [waves, other], EXPECTED, scatter)
    assert verdict is not None
    assert verdict.named is not None
    assert is_random(verdict.named.hypothesis)
    assert of_another_place(base, [waves], EXPECTED, [Scatter(500.0, 100.0, effect=TRACK)]) is None
    assert [is_of_one_place(fit) for fit in (waves, other, verdict.named)] == [True, False, False]


def test_noise_does_not_count_against_a_random_path():
    # chi2 is 1.5 times the expected value, and 2.25 times it with half as much noise again
    scatter = Scatter(60.0, 150.0, more=40.0, effect=TRACK)
    verdict = judge(fit(1000.0), [fit(900.0, "coulomb-level")], [], EXPECTED, [scatter])
    assert verdict.named is not None
    assert verdict.named.hypothesis.effects == (TRACK,)


def test_the_rest_of_a_rough_track_after_a_few_waves_is_not_a_second_effect():
    scatters = [Scatter(50.0, 90.0), Scatter(50.0, 80.0, effect=TRACK)]
    waves = fit(400.0, TRACK)
    verdict = judge(fit(1000.0), [waves], [], EXPECTED, scatters)
    assert verdict.named is not None
    assert verdict.named.hypothesis == waves.hypothesis  # the waves, and not a path of which only the size is known
    assert verdict.probabilities["unexplained"] > 0.2  # as for a verdict that names a path alone
    load = judge(fit(1000.0), [waves], [], EXPECTED, scatters[:1])
    assert load.named is not None
    assert len(load.named.hypothesis.effects) == 2


def test_the_stronger_of_two_named_effects_is_first():
    pairs = [fit(50.0, "coulomb-level", "drive-backlash")]
    for stronger, weaker in (("coulomb-level", "drive-backlash"), ("drive-backlash", "coulomb-level")):
        verdict = judge(fit(4000.0), [fit(900.0, stronger), fit(3000.0, weaker)], pairs, EXPECTED)
        assert list(verdict.probabilities)[:2] == [stronger, weaker]
