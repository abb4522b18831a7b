"""Effects of the drive, on a slide without friction: a mass, a spring and the effect."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from plant.effects.drive import even_m, extension_m
from plant.records import build
from plant.simulate import simulate
from tests.effects_rig import BLOCK_S, DISTURBED, HEAVY_KG, NO_FRICTION, NOMINAL, TAU, advance_by, rig, run

MASS_KG, STIFFNESS = 1.5, 11700.0


def released(effects, extension_m=2e-3, duration_s=0.5, **drive):
    """The slide let go with the drive held at a distance."""
    config = rig(effects, contact=NO_FRICTION, drive=drive)
    return run(config, np.zeros(round(duration_s / BLOCK_S)), {"s_d": extension_m})


def reference_m(force_N, extension_m, t_s):
    """Position of the released slide for a spring and damper of this force over extension and its rate."""

    def slope(_, state):
        x, v = state
        return v, force_N(extension_m - x, -v) / MASS_KG

    return solve_ivp(slope, (0, t_s[-1]), (0, 0), t_eval=t_s, rtol=1e-9, atol=1e-13, max_step=1e-3).y[0]


def test_a_damper_that_relaxes_pulls_nothing_across_a_gap():
    """Held in the middle of a gap of 2 mm, after it has pulled with 0.2 mm to go."""
    damper = {"form": "relaxing", "damping_Ns_per_m": 1000.0, "relaxation_s": 1.0}
    effects = {"drive-damping": damper, "drive-backlash": {"gap_m": 2e-3}}
    config = rig(effects, contact=NO_FRICTION, slide={"mass_kg": HEAVY_KG})
    held = run(config, [0.0] * 50, {"s_d": 0.5e-3, "arm_N": 5.0})
    assert np.abs(held.true_drive_force_N).max() == 0.0
    pulled = run(config, [0.0] * 50, {"s_d": 1.2e-3, "arm_N": 5.0})
    assert pulled.true_drive_force_N[-1] == pytest.approx(0.2e-3 * 11700.0 + 5.0 * math.exp(-0.05), rel=1e-6)


def test_damping_makes_the_free_oscillation_decay_as_its_closed_form():
    damping = 40.0
    result = released({"drive-damping": {"damping_Ns_per_m": damping - 10.0}}, damping_Ns_per_m=10.0)
    decay, natural = damping / (2 * MASS_KG), math.sqrt(STIFFNESS / MASS_KG)
    damped = math.sqrt(natural**2 - decay**2)
    course = np.exp(-decay * result.t_s) * (np.cos(damped * result.t_s) + decay / damped * np.sin(damped * result.t_s))
    assert result.true_position_m == pytest.approx(2e-3 * (1 - course), abs=1e-7)


@pytest.mark.parametrize("relaxation_s", [5e-4, 5e-3, 50e-3])
def test_a_damper_in_series_with_a_spring_follows_its_equations(relaxation_s):
    damping = 30.0
    table = {"form": "relaxing", "damping_Ns_per_m": damping, "relaxation_s": relaxation_s}
    result = released({"drive-damping": table})

    def slope(_, state):
        x, v, arm_N = state
        return v, (STIFFNESS * (2e-3 - x) + arm_N) / MASS_KG, -damping / relaxation_s * v - arm_N / relaxation_s

    x, _, arm_N = solve_ivp(slope, (0, 0.5), (0, 0, 0), t_eval=result.t_s, rtol=1e-10, atol=1e-13, max_step=1e-3).y
    assert result.true_position_m == pytest.approx(x, abs=1e-7)
    assert result.true_drive_force_N == pytest.approx(STIFFNESS * (2e-3 - x) + arm_N, abs=2e-3)


def test_a_damper_that_relaxes_at_once_is_the_viscous_one():
    relaxing = released({"drive-damping": {"form": "relaxing", "damping_Ns_per_m": 30.0, "relaxation_s": 1e-4}})
    viscous = released({"drive-damping": {"damping_Ns_per_m": 30.0}})
    assert relaxing.true_position_m == pytest.approx(viscous.true_position_m, abs=2e-5)


def test_stiffness_sets_the_frequency():
    result = released({"drive-stiffness": {"ratio": 0.21}})
    course = np.cos(1.1 * math.sqrt(STIFFNESS / MASS_KG) * result.t_s)
    assert result.true_position_m == pytest.approx(2e-3 * (1 - course), abs=1e-7)
    assert result.true_drive_force_N == pytest.approx(1.21 * STIFFNESS * 2e-3 * course, abs=1e-3)


def cubic_N(ratio):
    return lambda e: STIFFNESS * e * (1 + ratio * (e / 1e-3) ** 2)


def bilinear_N(ratio, knee_m):
    return lambda e: STIFFNESS * (e + ratio * math.copysign(max(abs(e) - knee_m, 0.0), e))


def slack_N(gap_m):
    return lambda e: STIFFNESS * math.copysign(max(abs(e) - gap_m / 2, 0.0), e)


SPRINGS = {
    "cubic": ({"drive-hardening": {"form": "cubic", "ratio": 0.3}}, cubic_N(0.3)),
    "softening": ({"drive-hardening": {"form": "cubic", "ratio": -0.05}}, cubic_N(-0.05)),
    "bilinear": ({"drive-hardening": {"form": "bilinear", "ratio": 0.6, "knee_m": 8e-4}}, bilinear_N(0.6, 8e-4)),
    "backlash": ({"drive-backlash": {"gap_m": 6e-4}}, slack_N(6e-4)),
}


@pytest.mark.parametrize("name", SPRINGS)
def test_a_spring_pulls_as_its_formula_and_swings_as_its_equation(name):
    effects, force_N = SPRINGS[name]
    result = released(effects)
    extension_m = result.true_drive_position_m - result.true_position_m
    assert result.true_drive_force_N == pytest.approx([force_N(e) for e in extension_m], abs=1e-9)
    expected_m = reference_m(lambda e, _: force_N(e), 2e-3, result.t_s)
    assert result.true_position_m == pytest.approx(expected_m, abs=2e-6)


def test_a_softening_spring_yields_at_its_largest_force_and_never_pushes():
    config = rig({"drive-hardening": {"form": "cubic", "ratio": -0.2}}, slide={"mass_kg": HEAVY_KG})
    result = run(config, np.full(1000, 0.01))
    largest_N = STIFFNESS * 2 / 3 * 1e-3 / math.sqrt(3 * 0.2)
    assert result.true_drive_force_N.max() == pytest.approx(largest_N, rel=1e-6)
    assert result.true_drive_force_N[-1] == pytest.approx(largest_N, rel=1e-6)


def test_a_drive_that_reverses_crosses_its_gap_before_it_pushes():
    """Held slide: 0.5 mm forward and back at 5 mm/s, 0.2 mm of it without a force, also for the damper."""
    gap_m, damping = 2e-4, 10.0
    config = rig({"drive-backlash": {"gap_m": gap_m}}, slide={"mass_kg": HEAVY_KG}, drive={"damping_Ns_per_m": damping})
    result = run(config, [0.005] * 100 + [-0.005] * 200)
    e = result.true_drive_position_m
    slack = np.abs(e) < gap_m / 2 - 1e-7
    assert slack.sum() == pytest.approx(3 * gap_m / 2 / 0.005 / 5e-5, abs=3)
    assert np.all(result.true_drive_force_N[slack] == 0.0)
    taut = np.abs(e) > gap_m / 2 + 1e-7
    expected_N = STIFFNESS * (e - np.sign(e) * gap_m / 2) + damping * np.where(result.t_s < 0.10001, 0.005, -0.005)
    assert result.true_drive_force_N[taut] == pytest.approx(expected_N[taut], abs=2e-3)


def test_ripple_in_time_adds_up_to_its_integral():
    ratio, f_Hz, phase = 0.3, 7.0, 0.5
    values = {"form": "time", "ratio": ratio, "frequency_Hz": f_Hz, "phase_rad": phase, "second_sin": 0.4}
    result = run(rig({"drive-speed-ripple": values}), np.full(1000, 5e-4))
    w, t_s = TAU * f_Hz, result.t_s
    first = math.cos(phase) - np.cos(w * t_s + phase)
    second = 0.2 * (math.cos(2 * phase) - np.cos(2 * (w * t_s + phase)))
    expected_m = 5e-4 * (t_s + ratio / w * (first + second))
    assert result.true_drive_position_m == pytest.approx(expected_m, abs=1e-12)


def test_ripple_of_a_screw_follows_its_own_angle():
    ratio, wavelength_m, phase = 0.4, 2e-4, 1.0
    values = {"form": "screw", "ratio": ratio, "wavelength_m": wavelength_m, "phase_rad": phase}
    result = run(rig({"drive-speed-ripple": values}), np.full(1000, 5e-4))

    even_m = 5e-4 * result.t_s
    lead_error_m = ratio * wavelength_m / TAU * (math.cos(phase) - np.cos(TAU * even_m / wavelength_m + phase))
    assert result.true_drive_position_m == pytest.approx(even_m + lead_error_m, abs=1e-12)
    # the motor turns evenly, and a turn is a wavelength
    turn_s = np.interp(wavelength_m, result.true_drive_position_m, result.t_s)
    assert turn_s == pytest.approx(wavelength_m / 5e-4, rel=1e-6)


def test_a_screw_that_gives_way_is_the_more_uneven_the_more_it_carries():
    """Independently: SciPy integrates drive and slide, a mass on the drive's spring that starts 2 mm behind the drive."""
    ratio, wavelength_m, phase, at_mps = 0.4, 2e-4, 1.0, 5e-4
    values = {"form": "load", "ratio": ratio, "wavelength_m": wavelength_m, "phase_rad": phase, "second_cos": 0.3}
    # the load is relative to the static friction, which vanishes at any speed
    contact = NO_FRICTION | {"static_force_N": 40.0, "stribeck_velocity_mps": 1e-9}
    config = rig({"drive-speed-ripple": values}, contact=contact)
    start_N = STIFFNESS * 2e-3
    result = run(config, np.full(1000, at_mps), {"s_d": 2e-3, "drive_N": start_N, "v": 1e-4, "v_r": 1e-4})

    def slope(t_s, state):
        drive_m, x, v = state
        force_N = STIFFNESS * (drive_m - x)
        angle_rad = TAU * at_mps * t_s / wavelength_m + phase
        shape = math.sin(angle_rad) + 0.3 * math.cos(2.0 * angle_rad)
        return at_mps * (1.0 + ratio * abs(force_N) / 40.0 * shape), v, force_N / MASS_KG

    t_s = result.t_s
    drive_m, x, _ = solve_ivp(
        slope, (0, t_s[-1]), (2e-3, 0.0, 1e-4), t_eval=t_s, rtol=1e-10, atol=1e-14, max_step=1e-3
    ).y
    assert result.true_drive_position_m == pytest.approx(drive_m, abs=1e-8)
    assert result.true_position_m == pytest.approx(x, abs=1e-6)
    assert np.ptp(drive_m - at_mps * t_s) > 1e-6


def test_a_screw_under_a_constant_load_is_uneven_in_proportion_to_it():
    """Closed form: the lead error of form "screw", times the load over F_s."""
    ratio, wavelength_m, phase, load = 0.4, 2e-4, 1.0, 0.6
    values = {"form": "load", "ratio": ratio, "wavelength_m": wavelength_m, "phase_rad": phase}
    config = rig({"drive-speed-ripple": values}, slide={"mass_kg": HEAVY_KG}, drive={"stiffness_N_per_m": 1.0})
    extended_m = (
        load * config.contact.static_force_N
    )  # of a spring of 1 N/m: the drive's way changes nothing of its force
    result = run(config, np.full(1000, 5e-4), {"s_d": extended_m, "drive_N": extended_m})
    even_m = 5e-4 * result.t_s
    lead_error_m = ratio * wavelength_m / TAU * (math.cos(phase) - np.cos(TAU * even_m / wavelength_m + phase))
    assert result.true_drive_position_m - extended_m == pytest.approx(even_m + load * lead_error_m, abs=1e-8)


@pytest.mark.parametrize("ratio", [0.4, 0.6])  # up to 1.6 and 2.1 times the speed
def test_where_a_screw_s_even_drive_would_be(ratio):
    wavelength_m = 2e-4
    values = {
        "form": "screw",
        "ratio": ratio,
        "wavelength_m": wavelength_m,
        "phase_rad": 1.0,
        "second_sin": 0.3,
        "second_cos": -0.5,
    }
    config = rig({"drive-speed-ripple": values})
    result = run(config, np.full(1000, 5e-4))
    params, _ = build(config)
    # the run begins at its even position, not where its lead error would have it
    error_m = ratio * wavelength_m / TAU * (-math.cos(1.0) - 0.15 * math.cos(2.0) - 0.25 * math.sin(2.0))
    found_m = np.array([even_m(params[0], position_m + error_m) for position_m in result.true_drive_position_m])
    assert found_m == pytest.approx(5e-4 * result.t_s, abs=1e-11)


def test_a_drive_that_only_pushes_with_a_force_has_no_damper():
    config = rig(contact=NO_FRICTION, drive={"damping_Ns_per_m": 100.0})
    result = run(config, np.full(200, 3.0), force_driven=True)
    assert result.true_drive_force_N == pytest.approx(3.0)
    assert result.true_position_m == pytest.approx(0.5 * 3.0 / MASS_KG * result.t_s**2, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("drive_mps", [5e-4, -5e-4])
def test_both_kernels_are_the_same_rig_where_nothing_is_on(drive_mps):
    """Apart from rounding, which a slip cannot amplify within the first second of creep."""
    config = rig(drive={"damping_Ns_per_m": 20.0})
    nominal = advance_by(NOMINAL, config, 1000, drive_mps, 2000.0, 2e-8)
    disturbed = advance_by(DISTURBED, config, 1000, drive_mps, 2000.0, 2e-8)
    size = np.abs(nominal).max(axis=1, keepdims=True)
    assert np.abs(disturbed - nominal).max(axis=1) == pytest.approx(np.zeros(len(size)), abs=1e-8 * size.max())
    assert np.all(np.abs(disturbed - nominal) <= 1e-6 * size)


def test_simulate_reports_the_drive_where_it_is():
    """Not where a linear spring of the force would put it."""
    result = simulate(rig({"drive-backlash": {"gap_m": 1e-3}}), 0.5)
    assert result.drive_position_m == pytest.approx(5e-4 * result.t_s, rel=1e-9)


@pytest.mark.parametrize("name", [*SPRINGS, "soft"])
@pytest.mark.parametrize("force_N", [15.0, -7.0])
def test_the_extension_for_a_force_is_where_the_spring_has_it(name, force_N):
    soft = {"drive-hardening": {"form": "bilinear", "ratio": -0.9, "knee_m": 1e-4}}, bilinear_N(-0.9, 1e-4)
    effects, spring_N = (SPRINGS | {"soft": soft})[name]
    assert spring_N(extension_m(build(rig(effects))[0][0], force_N)) == pytest.approx(force_N, rel=1e-9)
