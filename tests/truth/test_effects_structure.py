"""A frame and a base that yield: two masses on springs."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import eigh

from bridge.faults import Fault
from tests.effects_rig import BLOCK_S, NO_FRICTION, TAU, rig, run, stribeck_N

MASS_KG, STIFFNESS = 1.5, 11700.0


def frame(ratio, frequency_Hz, damping_ratio):
    values = {"ratio": ratio, "frequency_Hz": frequency_Hz, "damping_ratio": damping_ratio}
    return {"frame-compliance": values}


@pytest.mark.parametrize("frequency_Hz", [15.0, 80.0, 400.0])
@pytest.mark.parametrize("damping", [0.0, 30.0])
def test_slide_and_frame_swing_as_two_masses(frequency_Hz, damping):
    ratio, damping_ratio, extension_m = 0.5, 0.05, 1e-3
    config = rig(frame(ratio, frequency_Hz, damping_ratio), contact=NO_FRICTION, drive={"damping_Ns_per_m": damping})
    result = run(config, np.zeros(500), {"s_d": extension_m})
    stiffness = STIFFNESS / ratio
    mass_kg = stiffness / (TAU * frequency_Hz) ** 2
    loss = 2 * damping_ratio * math.sqrt(stiffness * mass_kg)

    def slope(_, state):
        x, v, q, q_rate = state
        pull_N = STIFFNESS * (extension_m - q - x) + damping * (-q_rate - v)
        return v, pull_N / MASS_KG, q_rate, (pull_N - stiffness * q - loss * q_rate) / mass_kg

    expected_m = solve_ivp(slope, (0, 0.5), np.zeros(4), t_eval=result.t_s, rtol=1e-9, atol=1e-13).y[0]
    assert result.true_position_m == pytest.approx(expected_m, abs=5e-6)


def test_the_modes_match_the_eigenproblem():
    ratio, frequency_Hz = 1.0, 40.0
    config = rig(frame(ratio, frequency_Hz, 0.0), contact=NO_FRICTION)
    result = run(config, np.zeros(4000), {"s_d": 1e-3})
    stiffness = STIFFNESS / ratio
    masses = np.diag([MASS_KG, stiffness / (TAU * frequency_Hz) ** 2])
    springs = np.array([[STIFFNESS, STIFFNESS], [STIFFNESS, STIFFNESS + stiffness]])
    modes_Hz = np.sqrt(eigh(springs, masses, eigvals_only=True)) / TAU
    force_N = result.true_drive_force_N
    # without damping nothing is lost
    assert np.abs(force_N[-20_000:]).max() == pytest.approx(np.abs(force_N[:20_000]).max(), rel=0.01)
    spectrum = np.abs(np.fft.rfft((force_N - force_N.mean()) * np.hanning(len(force_N))))
    peaks = np.flatnonzero((spectrum[1:-1] > spectrum[:-2]) & (spectrum[1:-1] > spectrum[2:])) + 1
    strongest_Hz = np.sort(peaks[np.argsort(spectrum[peaks])[-2:]]) / result.t_s[-1]
    assert strongest_Hz == pytest.approx(modes_Hz, abs=0.15)


def test_a_stiff_light_frame_is_a_softer_spring():
    ratio = 0.25
    result = run(rig(frame(ratio, 2000.0, 0.05), contact=NO_FRICTION), np.zeros(500), {"s_d": 1e-3})
    natural = math.sqrt(STIFFNESS / (1 + ratio) / MASS_KG)
    assert result.true_position_m == pytest.approx(1e-3 * (1 - np.cos(natural * result.t_s)), abs=1e-5)


def base(compliance_m_per_N, frequency_Hz, damping_ratio):
    values = {"frequency_Hz": frequency_Hz, "damping_ratio": damping_ratio, "compliance_m_per_N": compliance_m_per_N}
    return {"base-compliance": values}


def test_a_base_with_the_slide_stuck_on_it_is_an_oscillator_of_both_masses():
    """A force of 6 N at once: x = c F (1 - cos), the accelerometers read F / (m + M) cos; the contact gives 0.08 um."""
    compliance, frequency_Hz, pull_N = 2e-6, 100.0, 6.0
    base_kg = 1 / (compliance * (TAU * frequency_Hz) ** 2)
    stuck = {"pair": "C45-C45 @ 0.063", "backbone": "elasto-plastic"}
    config = rig(base(compliance, frequency_Hz, 0.0), contact=stuck)
    result = run(config, np.full(50, pull_N), force_driven=True)
    stiff = config.contact.stiffness_N_per_m
    springs = np.array([[1 / compliance + stiff, -stiff], [-stiff, stiff]])
    together = math.sqrt(eigh(springs, np.diag([base_kg, MASS_KG]), eigvals_only=True)[0])
    contact_m = pull_N / stiff
    expected_m = compliance * pull_N * (1 - np.cos(together * result.t_s))
    assert result.true_position_m == pytest.approx(expected_m, abs=3 * contact_m)
    late = result.t_s > 5e-3
    expected_mps2 = pull_N / (MASS_KG + base_kg) * np.cos(together * result.t_s)
    peak_mps2 = expected_mps2.max()
    assert result.base_accel_mps2[late] == pytest.approx(expected_mps2[late], abs=0.05 * peak_mps2)
    assert result.mass_accel_mps2[late] == pytest.approx(expected_mps2[late], abs=0.05 * peak_mps2)


@pytest.mark.parametrize(("compliance", "frequency_Hz"), [(1e-6, 150.0), (1e-5, 150.0), (1e-6, 500.0)])
def test_a_base_under_steady_friction_is_a_driven_oscillator(compliance, frequency_Hz):
    """Full friction from the start on; the base rings with up to 0.14 m/s, never as fast as the slide."""
    damping_ratio, v = 0.1, 0.5
    config = rig(base(compliance, frequency_Hz, damping_ratio), slide={"mass_kg": 1e7})
    c, w = config.contact, TAU * frequency_Hz
    bent_m = c.coulomb_force_N / c.stiffness_N_per_m
    result = run(config, np.full(100, v), {"v": v, "v_r": v, "z": bent_m, "g": c.coulomb_force_N})

    def rates(_, state):
        z, q, q_rate = state
        v_r = v - q_rate
        z_rate = v_r - c.stiffness_N_per_m * abs(v_r) * z / stribeck_N(c, v_r)
        friction_N = c.stiffness_N_per_m * z + c.damping_Ns_per_m * z_rate
        return z_rate, q_rate, w**2 * (compliance * friction_N - q) - 2 * damping_ratio * w * q_rate

    solved = solve_ivp(rates, (0, 0.1), (bent_m, 0.0, 0.0), "LSODA", t_eval=result.t_s, rtol=1e-8, atol=1e-14).y
    expected_mps2 = np.array([rates(0, state)[2] for state in solved.T])
    assert result.base_accel_mps2 == pytest.approx(expected_mps2, abs=0.03 * np.abs(expected_mps2).max())


@pytest.mark.parametrize("damping_ratio", [0.0, 0.05])
@pytest.mark.parametrize(("compliance", "frequency_Hz"), [(1e-6, 150.0), (1e-5, 150.0), (1e-6, 1500.0), (1e-3, 50.0)])
def test_a_light_base_on_a_stiff_contact_stays_finite(compliance, frequency_Hz, damping_ratio):
    config = rig(base(compliance, frequency_Hz, damping_ratio))
    result = run(config, np.full(400, 0.005), frequency_Hz=3000.0, amplitude_m=5e-8)
    assert np.abs(result.true_velocity_mps).max() < 5.0
    assert np.abs(result.true_friction_force_N).max() < 1000.0


def test_a_base_too_light_for_the_step_is_refused():
    with pytest.raises(Fault, match=r"effects.base-compliance.frequency_Hz = 2000.*6.3e-06 kg.*0\.0078 kg"):
        rig(base(1e-3, 2000.0, 0.05))


def test_halving_the_step_leaves_the_base_alone():
    def friction_N(step_s):
        solver = {"step_s": step_s, "samples_per_block": 20}
        config = rig(base(2e-6, 200.0, 0.05), solver=solver)
        return run(config, np.full(round(0.4 / BLOCK_S), 0.005)).true_friction_force_N

    coarse_N, fine_N = friction_N(1e-5), friction_N(2.5e-6)
    assert np.sqrt(np.mean((coarse_N - fine_N) ** 2)) < 0.02 * np.std(fine_N)
