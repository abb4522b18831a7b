"""Relations on made runs with a known cause: only the cause is named; a cause missing in the library is outside."""

import numpy as np
import pytest

from diagnosis.relations.answer import Relations, relations_of
from diagnosis.relations.decide import Decision, decision_of, ruled_out
from tests.unit.diagnosis.relations.kinematic import BLOCK_S, STIFFNESS_N_PER_M, Signals, in_units, rig, runs

pytestmark = pytest.mark.slow
T_S = (np.arange(8000) + 0.5) * BLOCK_S


def answer(cause=None) -> tuple[Relations, Decision]:
    relations = relations_of(rig(), runs(cause))
    return relations, decision_of(relations, rig())


def test_without_a_cause_nothing_is_named_and_the_noise_equals_the_sensor_noise():
    relations, decision = answer()
    assert decision == Decision((), ())
    assert [item.name for item in relations.answered] == ["spring", "motion", "drive", "exciter", "base"]
    spring = relations.answered[0]
    # means over two blocks, up to 120 of 250 Hz, of force noise and of two displacement sensors on the spring
    whole_N = np.hypot(6e-3, STIFFNESS_N_PER_M * 3e-8 * np.sqrt(2.0))
    assert spring.noise == pytest.approx(whole_N / np.sqrt(2.0) * np.sqrt(120.0 / 250.0), rel=0.1)
    assert spring.shares is not None
    assert spring.shares.unexplained < 0.2


def drifts(_: int, signals: Signals) -> None:
    signals["drive_force_N"] += 0.3 * (1.0 - np.exp(-T_S / 4.0))


def is_late(_: int, signals: Signals) -> None:
    signals["drive_force_N"] = np.interp(T_S - 2e-3, T_S, signals["drive_force_N"])


def hardens(_: int, signals: Signals) -> None:
    signals["drive_force_N"] += 3e-4 * signals["drive_force_N"] ** 3 / 15.0


def sags(_: int, signals: Signals) -> None:
    signals["base_shake_mps2"] *= 1.0 - 0.15 * signals["drive_force_N"] / 17.0


def reads_high(_: int, signals: Signals) -> None:
    signals["mass_accel_mps2"] *= 1.1


def is_uneven(_: int, signals: Signals) -> None:
    wave_m = 5e-6 * np.sin(2.0 * np.pi * signals["drive_position_m"] / 1e-3)
    signals["drive_position_m"] += wave_m
    signals["drive_force_N"] += STIFFNESS_N_PER_M * wave_m


@pytest.mark.parametrize(
    ("cause", "name", "relation"),
    [
        (drifts, "force-sensor-drift", "spring"),
        (is_late, "force-sensor-delay", "spring"),
        (hardens, "drive-hardening", "spring"),
        (sags, "piezo-sag", "exciter"),
        (reads_high, "accelerometer-gain", "motion"),
        (is_uneven, "drive-speed-ripple", "drive"),
    ],
)
def test_a_cause_is_named_by_its_relation_alone(cause, name: str, relation: str):
    relations, decision = answer(cause)
    assert [item.relation for item in decision.decided] == [relation]
    # a delay of 2 ms and three low-passes differ by less than these runs show
    alike = {"force-sensor-delay": "force-sensor-lag"}
    assert decision.decided[0].cause in {name, alike.get(name)}
    assert name not in ruled_out(relations, decision)
    assert decision.outside == ()
    answered = next(item for item in relations.answered if item.name == relation)
    assert answered.shares is not None
    share = answered.shares.causes[0]
    assert share.null_90 < share.interval_90[0] <= share.share <= share.interval_90[1] < 1.1


@pytest.mark.parametrize("cause", [None, hardens, is_uneven])
def test_no_answer_depends_on_the_units_of_a_record(cause):
    """A rotary record has 75 rad of travel in place of 16 mm, and 0.6 N m in place of 17 N."""
    _, decision = answer(cause)
    turning, in_rad = in_units(rig(), runs(cause), 75.0 / 0.016, 0.035)
    turned = decision_of(relations_of(turning, in_rad), turning)
    assert [item[:2] for item in turned.decided] == [item[:2] for item in decision.decided]
    assert turned.outside == decision.outside == ()
    for one, other in zip(turned.decided, decision.decided, strict=True):
        assert one.evidence == pytest.approx(other.evidence, rel=1e-3)


def test_effects_that_their_relation_does_not_show_are_ruled_out():
    without = ruled_out(*answer())
    assert {"drive-hardening", "force-sensor-drift", "drive-speed-ripple"} <= without
    # the relation of the exciter knows a few frequencies only, and friction is in none
    assert not {"piezo-sag", "piezo-roll-off", "coulomb-level", "base-compliance"} & without
    beside_a_drift = ruled_out(*answer(drifts))
    assert "force-sensor-drift" not in beside_a_drift
    assert {"drive-hardening", "drive-damping"} <= beside_a_drift


def test_the_size_of_a_drift_is_near_the_true_one():
    relations, _ = answer(drifts)
    spring = relations.answered[0]
    drift = next(i for i, term in enumerate(spring.chosen.terms) if term.cause == "force-sensor-drift")
    shown_N = spring.chosen.terms[drift].values[0][:, 0] * spring.chosen.sizes[drift][0]
    # the wander that ordinary sensors have takes a part of it
    assert np.ptp(shown_N) == pytest.approx(0.3 * (1.0 - np.exp(-2.0)), rel=0.3)


def saturates(_: int, signals: Signals) -> None:
    signals["drive_force_N"] -= 0.1 * np.maximum(signals["drive_force_N"] - 12.0, 0.0)


def runs_fast(_: int, signals: Signals) -> None:
    signals["mass_accel_mps2"] = np.interp(T_S * (1.0 + 4e-4), T_S, signals["mass_accel_mps2"])


def is_logged_apart(_: int, signals: Signals) -> None:
    signals["drive_force_N"] = np.interp(T_S * (1.0 + 4e-4), T_S, signals["drive_force_N"])


def drops_out(number: int, signals: Signals) -> None:
    for first in np.random.default_rng(number).integers(0, 7900, 12):
        signals["drive_force_N"][first : first + 10] *= 0.9


@pytest.mark.parametrize(
    ("cause", "relation", "what"),
    [
        (saturates, "spring", "over the extension"),
        (runs_fast, "motion", "acceleration-clock: in each run"),
        (is_logged_apart, "spring", "logger-clock: runs apart"),
        (drops_out, "spring", "in bursts"),
    ],
)
def test_a_cause_missing_in_the_library_is_reported_as_outside(cause, relation: str, what: str):
    _, decision = answer(cause)
    assert [item.relation for item in decision.outside] == [relation]
    assert decision.outside[0].what.startswith(what)
    assert decision.outside[0].size > decision.outside[0].noise > 0.0 or decision.outside[0].evidence > 25.0
    assert "drive-hardening" not in {item.cause for item in decision.decided}


def test_a_pattern_that_no_column_explains_is_reported_with_its_variable():
    def steps(_: int, signals: Signals) -> None:
        signals["drive_force_N"] += 0.05 * np.sin(2.0 * np.pi * signals["drive_force_N"] / 1.5)

    _, decision = answer(steps)
    assert [(item.relation, item.what) for item in decision.outside] == [("spring", "over the extension")]
    assert decision.outside[0].size == pytest.approx(0.05 / np.sqrt(2.0), rel=0.3)


def test_an_unevenness_too_small_to_pull_is_not_named_however_well_it_shows():
    def by_nanometres(_: int, signals: Signals) -> None:
        signals["drive_position_m"] += 7e-9 * np.sin(2.0 * np.pi * signals["drive_position_m"] / 1e-3)

    relations, decision = answer(by_nanometres)
    assert relations.answered[2].chosen.evidence > 50.0
    assert decision == Decision((), ())


def test_a_wave_of_a_pitch_that_only_a_short_way_shows_is_found_exactly():
    def is_finely_uneven(_: int, signals: Signals) -> None:
        wave_m = 1e-6 * np.sin(2.0 * np.pi * signals["drive_position_m"] / 8.7e-5)
        signals["drive_position_m"] += wave_m
        signals["drive_force_N"] += STIFFNESS_N_PER_M * wave_m

    relations, decision = answer(is_finely_uneven)
    assert [item.cause for item in decision.decided] == ["drive-speed-ripple"]
    assert relations.answered[2].chosen.terms[0].form == "every 0.087 mm"


def test_a_drive_whose_command_changes_is_not_uneven():
    """A motion that the held-out run does not repeat at the same place."""

    def wanders(number: int, signals: Signals) -> None:
        path_m = 3e-5 * np.sin(2.0 * np.pi * T_S / (3.0 + number) + 2.0 * number) * np.sin(2.0 * np.pi * T_S / 7.0)
        signals["drive_position_m"] += path_m
        signals["drive_force_N"] += STIFFNESS_N_PER_M * path_m

    relations, decision = answer(wanders)
    assert relations.answered[2].patterns[0].evidence > 25.0
    assert decision == Decision((), ())


def test_a_size_that_differs_between_runs_withdraws_the_name():
    def in_one_run(number: int, signals: Signals) -> None:
        if number == 0:
            hardens(number, signals)

    _, decision = answer(in_one_run)
    assert "drive-hardening" not in {item.cause for item in decision.decided}


def test_missing_channels_leave_their_relations_out_and_are_reported():
    lacking = [
        run._replace(signals={name: run.signals[name] for name in ("drive_force_N", "drive_position_m")})
        for run in runs()
    ]
    relations = relations_of(rig(), lacking)
    assert [item.name for item in relations.answered] == ["drive"]
    assert {item.name: item.why for item in relations.missing} == {
        "spring": "run-01.csv has no mass_position_m",
        "motion": "run-01.csv has no mass_accel_mps2",
        "exciter": "run-01.csv has no base_accel_mps2 that is fast enough",
        "base": "run-01.csv has no base_accel_mps2",
    }
