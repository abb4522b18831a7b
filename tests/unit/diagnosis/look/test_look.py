"""A record at a glance: the numbers of rigs whose truth the plant knows, and of saw-teeth made by hand."""

import numpy as np
import pytest

from diagnosis.look.creep import climb_of, fitted, limit_of
from diagnosis.look.look import LookResult, RecordFacts, look
from diagnosis.look.slip_shape import StackedFalls, shape_of
from diagnosis.look.words import limits_of_look
from diagnosis.slips import turning_points, turns
from plant.config import RigConfig
from plant.simulate import simulate
from tests.unit.diagnosis.look.rival import eight_lines


def saw(stiffness: float, fall_s: float, drop: float, speed_mps: float = 1.1e-3):
    stick_s = drop / (stiffness * speed_mps)
    period_s = stick_s + fall_s
    t_s = np.arange(0, 6, 2e-4)
    phase = t_s % period_s
    falling = 0.5 * drop * (1 + np.cos(np.pi * (phase - stick_s) / fall_s))
    return t_s, 5.0 * drop + np.where(phase < stick_s, drop * phase / stick_s, falling), period_s


@pytest.mark.parametrize("noise", [0.0, 0.04])
@pytest.mark.parametrize(
    ("stiffness", "fall_s", "drop"),
    [
        (168.0, 0.042, 0.019),
        (1002.0, 0.0174, 0.019),
        (2254.0, 0.0116, 0.022),
        (2254.0, 0.0116, 0.012),
        (11700.0, 0.036, 5.8),
    ],
)
@pytest.mark.slow
def test_slips_that_last_longer_than_their_sticks_are_counted(
    noise: float, stiffness: float, fall_s: float, drop: float
):
    t_s, force_N, period_s = saw(stiffness, fall_s, drop)
    seen = look(
        t_s, force_N + noise * drop * np.random.default_rng(2).standard_normal(len(t_s)), None, RecordFacts(1.1e-3)
    )
    assert seen is not None
    assert abs(seen.slips - 6.0 / period_s) <= 1.0
    numbers = seen.numbers
    assert numbers["period_s"].value == pytest.approx(period_s, rel=2e-3)
    assert numbers["static_force_N"].value == pytest.approx(6.0 * drop, rel=0.005)
    assert numbers["kinetic_force_N"].value == pytest.approx(5.5 * drop, rel=0.005)
    assert numbers["stiffness_N_per_m"].value == pytest.approx(stiffness, rel=0.01)


@pytest.mark.slow
def test_noise_does_not_lengthen_the_times_of_slips_and_sticks():
    held = []
    for fall_s in (0.01, 0.02, 0.05):
        for noise in (0.0, 0.004, 0.02):
            for seed in range(3):
                random = np.random.default_rng(seed)
                t_s, force_N, period_s = saw(1e4, fall_s, 10.0)
                t_s += random.uniform(0.0, 1e-4)
                seen = look(t_s, force_N + noise * 10.0 * random.standard_normal(len(t_s)), None, RecordFacts(1.1e-3))
                assert seen is not None
                slip, dwell = seen.numbers["slip_s"], seen.numbers["dwell_s"]
                assert slip.value == pytest.approx(fall_s, rel=0.12 if noise < 0.02 else 0.6)
                held += [slip.low <= fall_s <= slip.high, dwell.low <= period_s - fall_s <= dwell.high]
    assert np.mean(held) > 0.8


@pytest.mark.parametrize("fall_s", [2e-5, 1e-4, 3e-4, 6e-4])
def test_a_slip_between_two_samples_may_be_as_short_as_nothing(fall_s: float):
    t_s, force_N, period_s = saw(1e4, fall_s, 10.0)
    seen = look(t_s, force_N, None, RecordFacts(1.1e-3))
    assert seen is not None
    slip, dwell = seen.numbers["slip_s"], seen.numbers["dwell_s"]
    assert slip.low <= fall_s <= slip.high
    assert dwell.low <= period_s - fall_s <= dwell.high


@pytest.mark.parametrize("pair", ["C45-C45 @ 0.063", "C45-GGG40 @ 0.063"])
@pytest.mark.parametrize(("every", "noise_N"), [(10, 0.0), (20, 0.02), (20, 0.2)])
@pytest.mark.slow
def test_the_numbers_of_a_tribometer_are_within_a_percent(pair: str, every: int, noise_N: float) -> None:
    rig = RigConfig.model_validate({"contact": {"pair": pair}})
    made = simulate(rig, 12.0)
    t_s = made.t_s[::every]
    force_N = made.drive_force_N[::every] + noise_N * np.random.default_rng(4).standard_normal(len(t_s))
    speed_mps = rig.drive.profile[0][1]
    seen = look(t_s, force_N, None, RecordFacts(speed_mps, load_N=94.5))
    assert seen is not None
    truth = {
        "static_force_N": rig.contact.static_force_N,
        "kinetic_force_N": rig.contact.coulomb_force_N,
        "stiffness_N_per_m": rig.drive.stiffness_N_per_m,
        "mu_s": rig.contact.static_force_N / 94.5,
        "mu_k": rig.contact.coulomb_force_N / 94.5,
    }
    for name, value in truth.items():
        assert seen.numbers[name].value == pytest.approx(value, rel=0.01), name
    assert seen.numbers["mass_kg"].value == pytest.approx(rig.slide.mass_kg, rel=0.15)
    rival = eight_lines(t_s, force_N, speed_mps)
    assert seen.slips == rival.slips
    if noise_N >= 0.2:  # where the largest of many samples is too large
        assert abs(seen.numbers["static_force_N"].value - truth["static_force_N"]) < 0.3 * abs(
            rival.static_force_N - truth["static_force_N"]
        )


@pytest.mark.slow
def test_intervals_hold_the_truth_nine_times_in_ten() -> None:
    """Friction scatters from slip to slip; the interval is an interval of the mean of all slips."""
    random = np.random.default_rng(7)
    held = 0
    for _ in range(16):
        tops = 17.0 + 0.2 * random.standard_normal(25)
        pieces = [np.concatenate([np.linspace(12.0, top, 400), np.linspace(top, 12.0, 20)[1:-1]]) for top in tops]
        force_N = np.concatenate(pieces)
        force_N = force_N + 0.01 * random.standard_normal(len(force_N))
        seen = look(np.arange(len(force_N)) * 1e-3, force_N)
        assert seen is not None
        number = seen.numbers["swing_N"]
        held += number.low <= 5.0 <= number.high
    assert 11 <= held <= 16


@pytest.mark.parametrize("noise_N", [0.0, 0.02])
def test_a_stick_that_ends_below_the_limit_of_the_friction_shows_it(noise_N: float) -> None:
    """Dahl's contact on a spring, loaded to 95 % of its limit of 10 N, where a creeping slide breaks away."""
    random, fine_N = np.random.default_rng(3), np.linspace(6.0, 9.5, 5000)
    way_m = fine_N / 1e4 - 10.0 / 3e5 * np.log(1.0 - fine_N / 10.0)
    t_s = np.linspace(way_m[0], way_m[-1], 2000)
    climbs = [
        climb_of(t_s, np.interp(t_s, way_m, fine_N) + noise_N * random.standard_normal(len(t_s))) for _ in range(12)
    ]
    limit = limit_of([(climb, 9.5) for climb in climbs if climb is not None])
    assert limit is not None
    assert limit.value == pytest.approx(10.0 / 9.5, rel=0.01)
    assert climbs[0] is not None
    fit = fitted(climbs[0], 1.0, np.array([10.0]))
    assert fit.drive_m_per_N[0] == pytest.approx(1e-4, rel=0.03)
    assert fit.contact_m_per_N[0] == pytest.approx(1.0 / 3e5, rel=0.1)
    straight = climb_of(t_s, np.linspace(6.0, 9.5, len(t_s)) + 0.02 * random.standard_normal(len(t_s)))
    assert straight is not None
    assert limit_of([(straight, 9.5)] * 4) is None


def test_a_harmonic_swing_and_noise_are_not_taken_for_stick_slip() -> None:
    t_s = np.arange(0, 5, 1e-3)
    swings = look(t_s, 10.0 + np.sin(40.0 * t_s))
    assert swings is not None
    assert (swings.sticks, swings.slips) == (False, 0)
    even = look(t_s, 10.0 + 0.1 * np.random.default_rng(0).standard_normal(len(t_s)))
    assert even is not None
    assert even.slips == 0
    assert look(t_s[:8], t_s[:8]) is None


def test_both_directions_and_a_gap_count_as_parts() -> None:
    t_s, force_N, period_s = saw(11700.0, 0.036, 5.8)
    there_and_back = np.concatenate([force_N, -force_N])
    times = np.concatenate([t_s, t_s + 6.0])
    seen = look(times, there_and_back, None, RecordFacts(1.1e-3))
    assert seen is not None
    assert abs(seen.slips - 12.0 / period_s) <= 2.0
    assert {cycle.sign for cycle in seen.cycles} == {1.0, -1.0}
    gone = (t_s > 2.0) & (t_s < 4.0)
    gap = look(t_s[~gone], force_N[~gone], None, RecordFacts(1.1e-3))
    assert gap is not None
    assert gap.seconds == pytest.approx(4.0, abs=0.01)
    assert gap.numbers["period_s"].value == pytest.approx(period_s, rel=1e-3)


def ageing(speeds_mps: tuple[float, ...], halts_s: tuple[float, ...]) -> LookResult:
    """Slips at each speed, after each halt, with a breakaway force that rises by 1 N a decade of stick time."""
    stiffness, pieces, way, place = 10000.0, [], [], 0.0
    for speed_mps in speeds_mps:
        for halt_s in halts_s * 4:
            top, rate_N_per_s = 13.0, stiffness * speed_mps
            for _ in range(9):  # the stick is longer where its end is higher
                top = 13.0 + np.log10((top - 10.0) / rate_N_per_s + halt_s)
            climbs = [np.arange(begin, end, 1e-3 * rate_N_per_s) for begin, end in ((10.0, 11.0), (11.0, top))]
            halt, fall = np.full(round(1e3 * halt_s), 11.0), np.linspace(0, np.pi, 31)
            pieces += [climbs[0], halt, climbs[1]]
            pieces.append(10.0 + 0.5 * (top - 10.0) * (1 + np.cos(fall)))
            moves = np.concatenate([np.ones(len(climbs[0])), 0.0 * halt, np.ones(len(climbs[1]) + len(fall))])
            way.append(place + speed_mps * 1e-3 * np.cumsum(moves))
            place = way[-1][-1]
    force_N, position_m = np.concatenate(pieces), np.concatenate(way)
    seen = look(1e-3 * np.arange(len(force_N)), force_N, position_m)
    assert seen is not None
    return seen


def test_friction_over_speed_and_over_stick_time() -> None:
    """Long sticks of a slow drive do not show the effect of time alone; a halt of the drive does."""
    seen = ageing((2e-4, 5e-4, 2e-3), (0.0, 0.0))
    assert [round(1e3 * level.speed_mps, 1) for level in seen.at_speeds] == [0.2, 0.5, 2.0]
    assert "dwell_N_per_decade" not in seen.numbers
    assert any("the speed may be the cause; stop the drive" in line for line in limits_of_look(seen))
    assert not {"period_s", "slope_N_per_s", "dwell_s"} & seen.numbers.keys(), "a mean over speeds belongs to none"
    periods_s = [level.period_s.value for level in seen.at_speeds if level.period_s is not None]
    assert periods_s == sorted(periods_s, reverse=True)
    assert periods_s[0] > 5.0 * periods_s[2]
    halted = ageing((5e-4,), (0.0, 1.0, 4.0))
    assert halted.numbers["dwell_N_per_decade"].value == pytest.approx(1.0, rel=0.05)
    assert halted.numbers["stiffness_N_per_m"].value == pytest.approx(1e4, rel=0.1)


def test_one_stick_that_is_cut_short_shows_no_dependence_on_its_time() -> None:
    """Seven sticks to 16 N, and an eighth that a knock ends at 13 N."""
    tops = [*[16.0] * 7, 13.0, 12.0]
    force_N = np.concatenate([np.linspace(10.0, top, round(800 * (top - 10.0) / 6.0)) for top in tops])
    seen = look(1e-3 * np.arange(len(force_N)), force_N, None, RecordFacts(1e-3))
    assert seen is not None
    assert len(seen.cycles) == 8
    assert "dwell_N_per_decade" not in seen.numbers
    assert any("all sticks last alike" in line for line in limits_of_look(seen))


def test_a_resting_drive_adds_no_speed() -> None:
    """1 and 0.2 mm/s, then a rest; the noise of the position does not count as a third speed."""
    t_s = np.arange(0, 30, 1e-3)
    rng = np.random.default_rng(4)
    way_m = np.cumsum(np.where(t_s < 10.0, 1e-3, np.where(t_s < 20.0, 2e-4, 0.0))) * 1e-3
    seen = look(
        t_s, 10.0 + 0.05 * rng.standard_normal(len(t_s)), way_m + 1e-6 * rng.standard_normal(len(t_s)), RecordFacts()
    )
    assert seen is not None
    assert [round(1e3 * level.speed_mps, 1) for level in seen.at_speeds] == [0.2, 1.0]


def test_a_triangle_and_a_reversal_do_not_count_as_slips() -> None:
    t_s = np.arange(0, 20, 1e-3)
    noise_N = 0.05 * np.random.default_rng(3).standard_normal(len(t_s))
    triangle = look(t_s, 14.5 + np.abs(t_s % 2.0 - 1.0) + noise_N)
    assert triangle is not None
    assert (triangle.slips, len(triangle.cycles) > 5) == (0, True)
    turning = look(t_s, 14.5 * np.tanh(20.0 * np.cos(np.pi * t_s)) + noise_N, 5e-3 * np.sin(np.pi * t_s))
    assert turning is not None
    assert turning.slips == 0


@pytest.mark.slow
def test_a_drift_and_several_speeds_are_reported_and_an_even_record_shows_neither() -> None:
    def limits_text(tops: list[float], speeds_mps: list[float]) -> str:
        pieces: list[np.ndarray] = []
        for top, speed_mps in zip(tops, speeds_mps, strict=True):
            rise = round((top - 12.0) / (11_700.0 * speed_mps) * 2e3)
            pieces += [np.linspace(12.0, top, rise), np.linspace(top, 12.0, 40)[1:-1]]
        force_N = np.concatenate(pieces) + 0.01 * np.random.default_rng(3).standard_normal(sum(map(len, pieces)))
        seen = look(np.arange(len(force_N)) / 2e3, force_N, None, RecordFacts(1e-3))
        assert seen is not None
        return "; ".join(limits_of_look(seen))

    scatter = 17.0 + 0.1 * np.random.default_rng(5).standard_normal(30)
    even = limits_text(scatter.tolist(), [1e-3] * 30)
    assert "no steady level" not in even
    assert "no single speed" not in even
    assert "the breakaway rises by 2.85 N" in limits_text((scatter + np.linspace(0.0, 3.0, 30)).tolist(), [1e-3] * 30)
    assert "no single speed: sticks climb by 11.7 to 23.5" in limits_text(scatter.tolist(), [1e-3] * 15 + [2e-3] * 15)


@pytest.mark.parametrize("decay", [0.0, 0.06, 0.15])
def test_the_loss_of_a_fall_by_viscous_damping_is_not_taken_for_friction(decay: float) -> None:
    t_s = np.arange(0.0, 20.0, 1e-3)
    phase = (
        np.pi * (t_s % 1.0 - 0.97) / 0.03
    )  # phase of a swing from rest to rest; `decay` is the decay rate over the frequency
    end = -np.exp(-decay * np.pi)
    swing = np.exp(-decay * phase.clip(0.0)) * (np.cos(phase) + decay * np.sin(phase))
    share = np.where(phase < 0.0, end + (1.0 - end) * (t_s % 1.0) / 0.97, swing)
    force_N = 20.0 + 10.0 * share + 0.05 * np.random.default_rng(3).standard_normal(len(t_s))
    seen = look(t_s, force_N, None, RecordFacts(1e-3))
    assert seen is not None
    found = seen.numbers["kinetic_force_N"]
    assert found.value == pytest.approx(20.0, rel=0.006)
    assert found.low <= 20.0 <= found.high


def test_pieces_that_are_passed_over_hold_no_turn() -> None:
    random = np.random.default_rng(0)
    for length, step, drop in ((0, 1.0, 1.0), (255, 1.0, 1.0), (3000, 1.0, 3.0), (5000, 0.1, 1.0), (5000, 0.1, 30.0)):
        values = np.round(np.cumsum(step * random.standard_normal(length)), 1)  # with equal ones
        at = [0] * (length + 1)
        count = turns(values.tolist(), drop, at)
        assert turning_points(values, drop).tolist() == at[:count]


def test_a_fall_that_is_quicker_than_its_samples_shows_no_decay() -> None:
    since_s = np.tile(np.linspace(-0.01, 0.01, 21), 6)
    number = np.repeat(np.arange(6), 21)
    shape, _, _ = shape_of(StackedFalls(since_s, np.where(since_s < 0.0, 10.0, 5.0), number, 6, 0.02, 10.0, 5.0))
    assert shape is not None
    assert shape.ratio == 0.0
    assert shape.force_N == pytest.approx(7.5, abs=0.5)
