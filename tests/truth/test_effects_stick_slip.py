"""Whole stick-slip with an effect against SciPy's LSODA on independently written equations."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.effects_rig import TAU, rig, run

DRIVE_MPS = 0.002
MASS_KG, K_D = 1.5, 11700.0
CONTACT = rig().contact
K_T, H_T = CONTACT.stiffness_N_per_m, CONTACT.damping_Ns_per_m
F_C, F_S, V_S = CONTACT.coulomb_force_N, CONTACT.static_force_N, CONTACT.stribeck_velocity_mps
REACH_M = 10 * F_S / K_T
SLIPS = 2
DURATION_S = 2.2


def model(**changes):
    """The nominal rig's pieces; a test replaces those that its effect changes."""
    pieces = {
        "level": lambda _t_s, _x, _v_r: 1.0,
        "growth_N": lambda _: 0.0,
        "spring_N": lambda e: K_D * e,
        "viscous_N": lambda _: 0.0,
        "drive_m": lambda t_s: DRIVE_MPS * t_s,
        "alpha": lambda _z, _v_r, _g: 1.0,
        "lag_s": 0.0,
        "lag_m": 0.0,
        "frame": None,  # stiffness, mass, loss
        "base": None,
    }
    return SimpleNamespace(**(pieces | changes))


def slips_s(pieces):
    """When each slip passes ten times the drive velocity."""

    def slope(t_s, state):
        x, v, z, age_s, v_lag, q, q_rate, b, b_rate = state
        v_r = v - b_rate
        seen = v_lag if pieces.lag_s else v_r
        level = pieces.level(t_s, x, v_r)
        share = math.exp(-((seen / V_S) ** 2))
        if pieces.lag_m:
            share += pieces.late_share * (math.exp(-((v_lag / V_S) ** 2)) - share)
        g = level * (F_C + (F_S + pieces.growth_N(max(age_s, 0.0)) - F_C) * share)
        z_rate = v_r - pieces.alpha(z, v_r, g) * K_T * abs(v_r) * z / g
        friction_N = K_T * z + H_T * z_rate + pieces.viscous_N(v_r)
        pull_N = pieces.spring_N(pieces.drive_m(t_s) - q - x)
        lag_rate = (v_r - v_lag) / pieces.lag_s if pieces.lag_s else 0.0
        if pieces.lag_m:
            lag_rate = abs(v_r) / pieces.lag_m * (abs(v_r) - v_lag)
        q_accel = b_accel = 0.0
        if pieces.frame:
            stiffness, mass, loss = pieces.frame
            q_accel = (pull_N - stiffness * q - loss * q_rate) / mass
        if pieces.base:
            stiffness, mass, loss = pieces.base
            b_accel = (friction_N - stiffness * b - loss * b_rate) / mass
        age_rate = 1 - abs(v_r) * age_s / REACH_M
        return v, (pull_N - friction_N) / MASS_KG, z_rate, age_rate, lag_rate, q_rate, q_accel, b_rate, b_accel

    def fast(_, state):
        return state[1] - 10 * DRIVE_MPS

    fast.direction = 1.0
    fast.terminal = SLIPS
    small = (1e-12, 1e-12, 1e-15, 1e-9, 1e-10, 1e-12, 1e-10, 1e-13, 1e-10)
    solution = solve_ivp(slope, (0, DURATION_S), np.zeros(9), "LSODA", events=fast, rtol=1e-8, atol=small)
    return solution.t_events[0][:SLIPS]


def mode(stiffness, frequency_Hz, damping_ratio):
    mass = stiffness / (TAU * frequency_Hz) ** 2
    return stiffness, mass, 2 * damping_ratio * math.sqrt(stiffness * mass)


def elastic_share(z, v_r, g):
    """Dupont et al. 2002, equation 14, with breakaway at 0.7 of the reach."""
    if z * v_r <= 0:
        return 0.0
    reach = abs(z) * K_T / g
    if reach <= 0.7:
        return 0.0
    return 1.0 if reach >= 1 else 0.5 * math.sin(math.pi * (reach - 0.85) / 0.3) + 0.5


CASES = {
    "static-friction-ageing, log": (
        {"static-friction-ageing": {"form": "log", "ratio": 0.05, "age_scale_s": 0.01}},
        model(growth_N=lambda age_s: 0.05 * F_S * math.log1p(age_s / 0.01)),
    ),
    "static-friction-ageing, power": (
        {"static-friction-ageing": {"form": "power", "ratio": 0.1, "exponent": 0.4}},
        model(growth_N=lambda age_s: 0.1 * F_S * age_s**0.4),
    ),
    "static-friction-ageing, settling": (
        {"static-friction-ageing": {"form": "settling", "ratio": 0.15, "settling_s": 0.5}},
        model(growth_N=lambda age_s: 0.15 * F_S * (1 - math.exp(-age_s / 0.5))),
    ),
    "frictional-lag, time": ({"frictional-lag": {"lag_s": 0.003}}, model(lag_s=0.003)),
    "frictional-lag, distance": (
        {"frictional-lag": {"form": "distance", "distance_m": 1e-6, "share": 0.3}},
        model(lag_m=1e-6, late_share=0.3),
    ),
    "viscous-friction, linear": (
        {"viscous-friction": {"damping_Ns_per_m": 20.0}},
        model(viscous_N=lambda v_r: 20.0 * v_r),
    ),
    "position-dependent-friction": (
        {"position-dependent-friction": {"ratio": 0.1, "wavelength_m": 2e-3}},
        model(level=lambda _t_s, x, _v_r: 1 + 0.1 * math.sin(TAU * x / 2e-3)),
    ),
    "normal-load-fluctuation, sine": (
        {"normal-load-fluctuation": {"form": "sine", "ratio": 0.1, "frequency_Hz": 4.0}},
        model(level=lambda t_s, _x, _v_r: 1 + 0.1 * math.sin(TAU * 4.0 * t_s)),
    ),
    "drive-hardening, cubic": (
        {"drive-hardening": {"form": "cubic", "ratio": 0.1}},
        model(spring_N=lambda e: K_D * e * (1 + 0.1 * (e / 1e-3) ** 2)),
    ),
    "drive-backlash": (
        {"drive-backlash": {"gap_m": 2e-4}},
        model(spring_N=lambda e: K_D * math.copysign(max(abs(e) - 1e-4, 0.0), e)),
    ),
    "drive-speed-ripple, time": (
        {"drive-speed-ripple": {"form": "time", "ratio": 0.3, "frequency_Hz": 2.0}},
        model(drive_m=lambda t_s: DRIVE_MPS * (t_s + 0.3 / (TAU * 2) * (1 - math.cos(TAU * 2 * t_s)))),
    ),
    "frame-compliance": (
        {"frame-compliance": {"ratio": 0.4, "frequency_Hz": 30.0, "damping_ratio": 0.02}},
        model(frame=mode(K_D / 0.4, 30.0, 0.02)),
    ),
    "base-compliance": (
        {"base-compliance": {"compliance_m_per_N": 2e-6, "frequency_Hz": 120.0, "damping_ratio": 0.05}},
        model(base=mode(1 / 2e-6, 120.0, 0.05)),
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_slips_come_within_a_tenth_of_a_millisecond_of_lsoda(name):
    effects, pieces = CASES[name]
    found_s = rig_slips_s(rig(effects))
    expected_s = slips_s(pieces)
    assert len(expected_s) == SLIPS
    assert found_s == pytest.approx(expected_s, abs=1e-4)
    # and the effect is large
    assert np.abs(found_s - rig_slips_s(rig())).max() > 2e-3


def test_slips_of_the_elasto_plastic_contact_are_lsoda_s():
    contact = {"pair": "C45-C45 @ 0.063", "backbone": "elasto-plastic"}
    assert rig_slips_s(rig(contact=contact)) == pytest.approx(slips_s(model(alpha=elastic_share)), abs=1e-4)


def rig_slips_s(config):
    result = run(config, np.full(round(DURATION_S / 1e-3), DRIVE_MPS))
    t_s, v, level = result.t_s, result.true_velocity_mps, 10 * DRIVE_MPS
    before = np.flatnonzero((v[:-1] < level) & (v[1:] >= level))[:SLIPS]
    return t_s[before] + (level - v[before]) / (v[before + 1] - v[before]) * (t_s[before + 1] - t_s[before])
