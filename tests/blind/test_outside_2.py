"""The second list of effects outside the library: each formula behaves as described, and sets have no other effects."""

from collections import Counter

import numpy as np
import pytest

from tests.blind.generator import OUTSIDE, OUTSIDE_2, Case, Effect, simulate
from tests.blind.generator.kernel import SAMPLE_RATE_HZ
from tests.blind.generator.library import formulas_of
from tests.blind.generator.outside_2 import played
from tests.blind.generator.runs import Plan, tracks_of
from tests.blind.generators import generator
from tests.blind.strata import draw

BUSY = Plan(drive=((0.0, 2e-3), (0.9, -3e-3)), vibration=((0.3, 2000.0), (1.5, 4000.0)), duration_s=2.0)
SAMPLES = 2 * SAMPLE_RATE_HZ
T_S = np.arange(SAMPLES) / SAMPLE_RATE_HZ


def sensed(name: str, strength: float, **given) -> dict[str, np.ndarray]:
    """Signals of a saw tooth and an even motion after an effect of a sensor."""
    (formula,) = formulas_of(name)
    signals = {
        "t_s": T_S,
        "drive_force_N": 12.0 + 4.0 * np.abs((T_S % 1.0) - 0.5) * 2.0,
        "mass_position_m": 0.02 + 1e-3 * T_S,
        "base_accel_mps2": np.where(T_S > 1.0, 7.1 * np.sin(2.0 * np.pi * 3000.0 * T_S), 0.0),
    }
    formula.sense(signals, strength, formula.draw(np.random.default_rng(1)) | given)
    return signals


def tracks(name: str, number: int = 0, strength: float = 1.0, **given):
    """A run's inputs after an effect of its inputs."""
    (formula,) = formulas_of(name)
    made = tracks_of(BUSY, number, 0.02)
    formula.run(made, strength, formula.draw(np.random.default_rng(1)) | given)
    return made


def test_a_set_of_the_newer_generator_has_each_newer_effect_in_turn_and_no_older_one():
    cases = draw(generator("independent-2"), 200, 5)
    outside = Counter(case.effects[0].name for case in cases if case.stratum == "outside")
    assert outside.keys() == set(OUTSIDE_2)
    assert set(outside.values()) == {3, 4}
    assert not {*OUTSIDE} & {*OUTSIDE_2}
    assert sum(case.stratum == "no-gap" for case in cases) >= 30
    assert generator("independent").outside == OUTSIDE


def test_a_follower_with_play_rests_after_each_reversal():
    way_m = np.concatenate((np.linspace(0.0, 1e-3, 100), np.linspace(1e-3, 0.0, 100)))
    read_m = played(way_m, 1e-4)
    assert read_m[99] == pytest.approx(0.95e-3)
    assert (read_m[100:109] == read_m[99]).all()
    assert read_m[-1] == pytest.approx(0.05e-3)


def test_a_multiplexer_repeats_past_values_and_never_shows_future_ones():
    held_m = sensed("slow-multiplexer", 1.0, turn_s=0.1)["mass_position_m"]
    true_m = 0.02 + 1e-3 * T_S
    assert len(np.unique(held_m)) == pytest.approx(20, abs=1)
    assert (true_m - held_m).min() >= 0.0
    assert (true_m - held_m).max() == pytest.approx(1e-3 * 0.1, rel=0.01)


def test_an_amplifier_leaves_its_upper_range_below_where_it_enters_it():
    force_N = sensed("range-switching", 1.0, up_N=14.0, hysteresis_N=1.0, zero_N=0.5, step_N=0.2)["drive_force_N"]
    true_N = 12.0 + 4.0 * np.abs((T_S % 1.0) - 0.5) * 2.0
    upper = np.abs(force_N - true_N) > 0.3
    assert true_N[upper & (T_S < 0.4)].min() == pytest.approx(13.0, abs=0.01)  # falling
    assert true_N[upper & (T_S > 0.6) & (T_S < 1.0)].min() == pytest.approx(14.0, abs=0.01)  # rising
    assert np.array_equal(force_N[~upper], true_N[~upper])


def test_a_rectified_vibration_moves_the_zero_by_its_power():
    force_N = sensed("vibration-rectified", 1.0, zero_N=0.8, smooth_s=0.02)["drive_force_N"]
    more_N = force_N - (12.0 + 4.0 * np.abs((T_S % 1.0) - 0.5) * 2.0)
    assert np.abs(more_N[T_S < 1.0]).max() == 0.0
    assert more_N[-SAMPLE_RATE_HZ // 2 :].mean() == pytest.approx(0.8, rel=0.01)


def test_a_folded_line_has_its_frequency():
    more_N = (
        sensed("converter-line", 1.0, folded_Hz=6.0, line_N=0.5)["drive_force_N"]
        - sensed("converter-line", 0.0)["drive_force_N"]
    )
    spectrum = np.abs(np.fft.rfft(more_N)) / SAMPLES * 2.0
    assert np.fft.rfftfreq(SAMPLES, 1.0 / SAMPLE_RATE_HZ)[spectrum.argmax()] == pytest.approx(6.0, abs=0.7)
    assert np.abs(more_N).max() == pytest.approx(0.5, rel=1e-3)


def test_a_belt_s_error_goes_with_its_place_both_ways():
    made = tracks("belt-mesh", pitch_m=2e-3, error_m=5e-5, second=0.0)
    place_m = made.origin_m + made.drive_m
    there, back = (np.interp(0.0209, *xy) for xy in _ways(place_m, made.unseen_m))
    assert there == pytest.approx(back, abs=1e-9)
    assert np.ptp(made.unseen_m) == pytest.approx(1e-4, rel=0.02)
    assert made.unseen_m[0] == 0.0


def _ways(place_m: np.ndarray, error_m: np.ndarray):
    turn = int(place_m.argmax())
    return (place_m[:turn], error_m[:turn]), (place_m[turn:][::-1], error_m[turn:][::-1])


def test_levels_step_up_and_wear_off():
    step = tracks("wear-step", height=0.1, rise_s=0.05, settles_s=1.0).load
    assert (step[0], round(float(step.max()), 2)) == (1.0, 1.1)
    assert 1.05 < step[-1] < step.max()
    humid = [tracks("capillary-bridges", number, height=0.2, wears_m=1e-3).load for number in range(4)]
    assert len({round(float(load[0]), 4) for load in humid}) == 4  # each run waited for another time
    assert all(1.0 < load[0] <= 1.2 and load[-1] - 1.0 < 0.05 * (load[0] - 1.0) for load in humid)


def test_a_beating_exciter_swings_around_the_commanded_amplitude():
    made = tracks("exciter-beat", depth=0.4, frequency_Hz=5.0)
    ratio = (made.amplitude_m / np.where(made.commanded_m > 0.0, made.commanded_m, np.nan))[8000:28000]
    assert (np.nanmin(ratio), np.nanmax(ratio)) == pytest.approx((0.6, 1.4), abs=0.01)


def test_starvation_grows_one_way_and_a_reversal_ends_it():
    exact = {"tolerances": 0.0, "roughness": 0.0, "sensors": 0.0, "backbone": "lugre"}
    (formula,) = formulas_of("lubricant-starvation")
    effect = Effect(formula, {"starvation": 0.2, "starvation_m": 1e-3})
    dry, plain = (simulate(Case(effects=e, **exact), 3, (BUSY,))[0]["drive_force_N"] for e in ((effect,), ()))
    ratio = np.abs(dry) / np.maximum(np.abs(plain), 1.0)

    def between(first_s: float, last_s: float) -> float:
        return float(np.median(ratio[int(first_s * SAMPLE_RATE_HZ) : int(last_s * SAMPLE_RATE_HZ)]))

    assert between(1.9, 2.0) - 1.0 > 0.1  # 2 mm after the reversal
    assert between(1.9, 2.0) > between(1.35, 1.45) + 0.03
