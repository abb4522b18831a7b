"""Effects without memory: friction in steady sliding equals the formula."""

import math

import numpy as np
import pytest

from plant.effects.friction import level
from plant.records import build
from tests.effects_rig import HEAVY_KG, TAU, rig, run, stribeck_N, towed

CONTACT = rig().contact
FAST_MPS = 0.005  # ten Stribeck velocities: Coulomb friction alone


@pytest.mark.parametrize("v_mps", [1e-4, 5e-4, 5e-3, -5e-4])
@pytest.mark.parametrize(("form", "power"), [("linear", 1), ("quadratic", 2)])
def test_viscous_friction_adds_to_the_stribeck_curve(form, power, v_mps):
    unit = "damping_Ns_per_m" if power == 1 else "damping_Ns2_per_m2"
    damping = 1e3 if power == 1 else 1e6
    result = towed({"viscous-friction": {"form": form, unit: damping}}, v_mps, 0.1)
    expected_N = math.copysign(stribeck_N(CONTACT, v_mps) + damping * abs(v_mps) ** power, v_mps)
    assert result.true_friction_force_N == pytest.approx(expected_N, rel=2e-4)


@pytest.mark.parametrize("v_ratio", [0.5, 1.0, 3.0])
def test_a_stribeck_curve_with_a_tail(v_ratio):
    """Seven tenths of Hess and Soom's curve, which at three Stribeck velocities has not fallen as the Gaussian has."""
    v_mps = v_ratio * CONTACT.stribeck_velocity_mps
    result = towed({}, v_mps, 0.5, contact={"stribeck_tail": 0.7})
    fall = 0.3 * math.exp(-(v_ratio**2)) + 0.7 / (1.0 + v_ratio**2)
    expected_N = CONTACT.coulomb_force_N + (CONTACT.static_force_N - CONTACT.coulomb_force_N) * fall
    assert result.true_friction_force_N[-1] == pytest.approx(expected_N, rel=1e-5)


def test_two_factors_below_nothing_make_no_friction():
    """A drift that has used up its friction, and a load whose wave falls below nothing."""
    load = {"ratio": 0.9, "frequency_Hz": 1.0, "phase_rad": -0.5 * math.pi, "second_cos": 1.0}
    effects = {"friction-drift": {"form": "linear", "rate_per_s": -0.1}, "normal-load-fluctuation": load}
    params, _ = build(rig(effects))
    low = [level(params[0], t_s, 0.0, 1e-3, -1.0, 0.0) for t_s in (5.0, 20.0, 30.0)]
    assert low == [0.01, 0.01, 0.01]
    assert level(params[0], 5.0, 0.0, 1e-3, 1.0, 0.0) == pytest.approx(0.5 * (1.0 + 0.9 * (1.0 - 1.0)))


def test_friction_along_the_track_is_a_sine_with_its_second_harmonic():
    values = {"ratio": 0.1, "wavelength_m": 2e-3, "phase_rad": 0.7, "second_sin": 0.4, "second_cos": -0.3}
    result = towed({"position-dependent-friction": values}, FAST_MPS, 1.0)
    angle = TAU * result.true_position_m / 2e-3 + 0.7
    wave = np.sin(angle) + 0.4 * np.sin(2 * angle) - 0.3 * np.cos(2 * angle)
    assert result.true_friction_force_N == pytest.approx(CONTACT.coulomb_force_N * (1 + 0.1 * wave), rel=4e-4)


def test_friction_along_the_track_may_be_two_waves():
    other = {"other_share": 0.6, "other_wavelength_m": 7e-4, "other_phase_rad": -1.1}
    values = {"form": "two-waves", "ratio": 0.1, "wavelength_m": 2e-3, "phase_rad": 0.7, **other}
    result = towed({"position-dependent-friction": values}, FAST_MPS, 1.0)
    x_m = result.true_position_m
    wave = np.sin(TAU * x_m / 2e-3 + 0.7) + 0.6 * np.sin(TAU * x_m / 7e-4 - 1.1)
    assert result.true_friction_force_N == pytest.approx(CONTACT.coulomb_force_N * (1 + 0.1 * wave), rel=6e-4)


def test_friction_along_the_track_may_have_bumps():
    values = {"form": "bumps", "ratio": -0.2, "wavelength_m": 2e-3, "phase_rad": 0.7, "width": 0.1}
    result = towed({"position-dependent-friction": values}, FAST_MPS, 1.0)
    nearest = np.round(result.true_position_m / 2e-3 + 0.7 / TAU) - 0.7 / TAU
    apart = result.true_position_m / 2e-3 - nearest
    bumps = np.exp(-0.5 * (apart / 0.1) ** 2)
    assert bumps.max() > 0.999
    assert result.true_friction_force_N == pytest.approx(CONTACT.coulomb_force_N * (1 - 0.2 * bumps), rel=2e-3)


@pytest.mark.parametrize(
    ("form", "forward", "backward"),
    [("backward", 1.0, 1.2), ("both", 1.1, 0.9), ("kinetic", 1.0, 1.2)],
    ids=["backward", "both", "kinetic"],
)
def test_friction_differs_by_direction_also_after_a_reversal(form, forward, backward):
    """A force decelerates the heavy slide from 5 mm/s to -5 mm/s within 0.1 s."""
    config = rig({"direction-dependent-friction": {"form": form, "ratio": 0.2}}, slide={"mass_kg": HEAVY_KG})
    force_N = np.concatenate([np.zeros(50), np.full(100, -0.1 * HEAVY_KG), np.zeros(50)])
    result = run(config, force_N, {"v": FAST_MPS, "v_r": FAST_MPS}, force_driven=True)
    assert result.true_velocity_mps[-1] == pytest.approx(-FAST_MPS, rel=1e-3)
    assert result.true_friction_force_N[900] == pytest.approx(forward * CONTACT.coulomb_force_N, rel=1e-4)
    assert result.true_friction_force_N[-1] == pytest.approx(-backward * CONTACT.coulomb_force_N, rel=1e-4)


def test_kinetic_friction_that_differs_by_direction_leaves_the_static_one():
    """A drive of -1 mm/s on the paper's spring: the force breaks away at -F_s, and falls further with a smaller F_c."""
    forces = {}
    for ratio in (-0.2, 0.0):
        effects = {"direction-dependent-friction": {"form": "kinetic", "ratio": ratio}} if ratio else {}
        result = run(rig(effects), np.full(6000, -1e-3), {})
        forces[ratio] = result.true_drive_force_N
    assert forces[-0.2].min() == pytest.approx(forces[0.0].min(), rel=2e-3)
    fall = {ratio: float(np.ptp(force_N[len(force_N) // 2 :])) for ratio, force_N in forces.items()}
    assert fall[-0.2] > fall[0.0] + 4.0


def test_a_load_that_swings_swings_friction():
    values = {"form": "sine", "ratio": 0.2, "frequency_Hz": 5.0, "phase_rad": -0.4}
    result = towed({"normal-load-fluctuation": values}, FAST_MPS, 1.0)
    sine = np.sin(TAU * 5.0 * result.t_s - 0.4)
    assert result.true_friction_force_N == pytest.approx(CONTACT.coulomb_force_N * (1 + 0.2 * sine), rel=5e-4)


@pytest.mark.parametrize(
    ("values", "course"),
    [
        ({"form": "linear", "rate_per_s": 0.05}, lambda t_s: 1 + 0.05 * t_s),
        ({"form": "settling", "ratio": -0.2, "settling_s": 0.5}, lambda t_s: 1 - 0.2 * (1 - np.exp(-t_s / 0.5))),
        (
            {"form": "session", "ratio": -0.2, "settling_s": 2.0, "before_s": 1.0},
            lambda t_s: 1 - 0.2 * (1 - np.exp(-(1.0 + t_s) / 2.0)),
        ),
    ],
    ids=["linear", "settling", "session"],
)
def test_friction_drifts(values, course):
    result = towed({"friction-drift": values}, FAST_MPS, 2.0)
    expected_N = CONTACT.coulomb_force_N * course(result.t_s)
    assert result.true_friction_force_N == pytest.approx(expected_N, rel=1e-4)


@pytest.mark.parametrize(
    ("effect", "key"),
    [
        ("coulomb-level", "coulomb_force_N"),
        ("static-level", "static_force_N"),
        ("stribeck-velocity", "stribeck_velocity_mps"),
    ],
)
@pytest.mark.parametrize("v_mps", [2e-5, 4e-4, 8e-4, 5e-3])
def test_a_level_moves_the_stribeck_curve(effect, key, v_mps):
    result = towed({effect: {"ratio": 0.15}}, v_mps, 0.2)
    moved = CONTACT.model_copy(update={key: 1.15 * getattr(CONTACT, key)})
    assert result.true_friction_force_N[-1] == pytest.approx(stribeck_N(moved, v_mps), rel=1e-5)


def test_effects_of_friction_multiply_and_lower_it_to_a_hundredth_at_most():
    half = {"position-dependent-friction": {"ratio": 0.5, "wavelength_m": 1.0, "phase_rad": -math.pi / 2}}
    drifted = {"friction-drift": {"form": "settling", "ratio": -0.5, "settling_s": 0.1}}
    result = towed(half | drifted, FAST_MPS, 2.0)
    assert result.true_friction_force_N[-1] == pytest.approx(0.25 * CONTACT.coulomb_force_N, rel=2e-3)
    gone = {"normal-load-fluctuation": {"form": "sine", "ratio": 0.9, "phase_rad": -math.pi / 2, "frequency_Hz": 1e-3}}
    result = towed(
        half | drifted | gone | {"direction-dependent-friction": {"form": "both", "ratio": -0.9}}, FAST_MPS, 2.0
    )
    assert result.true_friction_force_N[-1] == pytest.approx(0.01375 * CONTACT.coulomb_force_N, rel=2e-2)
    result = towed(gone | {"friction-drift": {"rate_per_s": -0.1}, "static-level": {}} | half, FAST_MPS, 9.9)
    assert result.true_friction_force_N[-1] == pytest.approx(0.01 * CONTACT.coulomb_force_N, rel=1e-3)
