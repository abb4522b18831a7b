"""Friction with a memory: it ages at rest and lags behind the velocity."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from plant.effects.friction_memory import LONGEST_LAG_S, late_mps
from plant.records import build
from tests.effects_rig import BLOCK_S, HEAVY_KG, TAU, rig, run, stribeck_N

CONTACT = rig().contact
K_T, H_T = CONTACT.stiffness_N_per_m, CONTACT.damping_Ns_per_m
# slow enough to show the bristle, quick enough not to age; the Stribeck curve is flat and the damping out of the way
PULL_MPS = 1e-4
PULL_S = 0.1
FLAT = {"pair": "C45-C45 @ 0.063", "damping_Ns_per_m": 0.0, "stribeck_velocity_mps": 0.05}


def pulled_after(rest_s, ageing):
    """Friction of a slide that rests and is then pulled at a steady velocity, after one block of acceleration."""
    config = rig({"static-friction-ageing": ageing}, slide={"mass_kg": HEAVY_KG}, contact=FLAT)
    force_N = np.zeros(round((rest_s + PULL_S) / BLOCK_S))
    force_N[round(rest_s / BLOCK_S)] = HEAVY_KG * PULL_MPS / BLOCK_S
    result = run(config, force_N, force_driven=True)
    pulled = result.t_s > rest_s + BLOCK_S
    return result.t_s[pulled] - rest_s - BLOCK_S, result.true_friction_force_N[pulled]


def growth_N(ageing, age_s):
    if ageing["form"] == "log":
        return ageing["ratio"] * CONTACT.static_force_N * math.log(1 + age_s / ageing["age_scale_s"])
    if ageing["form"] == "settling":
        return ageing["ratio"] * CONTACT.static_force_N * (1 - math.exp(-age_s / ageing["settling_s"]))
    return ageing["ratio"] * CONTACT.static_force_N * age_s ** ageing["exponent"]


FORMS = [
    {"form": "log", "ratio": 0.03, "age_scale_s": 1e-3},
    {"form": "power", "ratio": 0.05, "exponent": 0.3},
    {"form": "settling", "ratio": 0.1, "settling_s": 0.3},
]


@pytest.mark.parametrize("ageing", FORMS, ids=lambda ageing: ageing["form"])
def test_breakaway_after_a_rest_follows_from_bristle_and_age(ageing):
    """Independently: z' = v - k_t v z / g, age' = 1 - v age / L with L ten bristle reaches, from an age of the rest."""
    rest_s = 0.5
    reach_m = 10 * CONTACT.static_force_N / K_T

    def slope(t_s, state):
        z, age_s = state
        v = PULL_MPS * min(1 + t_s / BLOCK_S, 1.0)
        g = CONTACT.static_force_N + growth_N(ageing, age_s)
        return v * (1 - K_T * z / g), 1 - v * age_s / reach_m

    t_s, friction_N = pulled_after(rest_s, ageing)
    z, _ = solve_ivp(slope, (-BLOCK_S, t_s[-1]), (0.0, rest_s), "LSODA", t_eval=t_s, rtol=1e-9, atol=1e-15).y
    assert friction_N.max() > CONTACT.static_force_N + 0.7 * growth_N(ageing, rest_s)
    assert friction_N == pytest.approx(K_T * z, abs=0.15)  # 20 us of the steepest rise
    assert friction_N[500:] == pytest.approx(K_T * z[500:], rel=1e-3)


@pytest.mark.parametrize("ageing", FORMS, ids=lambda ageing: ageing["form"])
def test_the_static_friction_may_refer_to_a_rested_contact(ageing):
    from_new, from_rested = (pulled_after(0.5, ageing | {"rested_s": rested_s})[1].max() for rested_s in (0.0, 0.2))
    assert from_new - from_rested == pytest.approx(growth_N(ageing, 0.2), rel=0.03)


@pytest.mark.parametrize("ageing", FORMS, ids=lambda ageing: ageing["form"])
def test_breakaway_grows_with_the_rest_as_the_formula(ageing):
    """The bristle's own reach takes a share of the age that is the same after every rest."""
    rests_s = (0.15, 0.3, 0.6) if ageing["form"] == "settling" else (0.3, 1.0, 3.0)
    peaks_N = [pulled_after(rest_s, ageing)[1].max() - CONTACT.static_force_N for rest_s in rests_s]
    if ageing["form"] == "log":
        step_N = ageing["ratio"] * CONTACT.static_force_N * math.log(3)
        assert np.diff(peaks_N) == pytest.approx([math.log(1 / 0.3) / math.log(3) * step_N, step_N], rel=0.06)
    elif ageing["form"] == "settling":
        left = 1.0 - np.array(peaks_N) / (ageing["ratio"] * CONTACT.static_force_N)
        first_per_s, other_per_s = -np.diff(np.log(left)) / np.diff(rests_s)
        assert first_per_s == pytest.approx(other_per_s, rel=0.05)
        assert 0.5 < first_per_s * ageing["settling_s"] < 1.0
    else:
        orders = np.diff(np.log(peaks_N)) / np.diff(np.log(rests_s))
        assert orders == pytest.approx(ageing["exponent"], rel=0.05)


def swinging(lag, frequency_Hz=10.0):
    """A heavy slide whose velocity swings between 0.1 and 0.9 mm/s, driven by force; v(t) exact at the blocks."""
    blocks = np.arange(round(3 / frequency_Hz / BLOCK_S) + 1) * BLOCK_S
    v_mps = 5e-4 + 4e-4 * np.sin(TAU * frequency_Hz * blocks)
    config = rig({"frictional-lag": lag}, slide={"mass_kg": HEAVY_KG})
    start = {"v": v_mps[0], "v_r": v_mps[0], "v_lag": v_mps[0], "z": stribeck_N(CONTACT, v_mps[0]) / K_T}
    return run(config, HEAVY_KG * np.diff(v_mps) / BLOCK_S, start, force_driven=True), blocks, v_mps


def test_lag_is_first_order_in_front_of_the_stribeck_curve():
    lag_s = 5e-3
    result, blocks_s, block_mps = swinging({"lag_s": lag_s})

    def velocity(t_s):
        return np.interp(t_s, blocks_s, block_mps)

    def slope(t_s, state):
        z, v_lag = state
        v = velocity(t_s)
        return v * (1 - K_T * z / stribeck_N(CONTACT, v_lag)), (v - v_lag) / lag_s

    start = (stribeck_N(CONTACT, block_mps[0]) / K_T, block_mps[0])
    t_s = result.t_s
    z, v_lag = solve_ivp(
        slope, (0, t_s[-1]), start, "LSODA", t_eval=t_s, rtol=1e-8, atol=(1e-14, 1e-10), max_step=BLOCK_S
    ).y
    v = velocity(t_s)
    expected_N = K_T * z + H_T * v * (1 - K_T * z / stribeck_N(CONTACT, v_lag))
    assert result.true_friction_force_N[40:] == pytest.approx(expected_N[40:], abs=0.01)
    assert np.ptp(expected_N) > 1.5


def test_a_dead_time_shows_the_stribeck_curve_an_earlier_speed():
    delay_s = 5e-3
    result, blocks_s, block_mps = swinging({"form": "dead-time", "delay_s": delay_s})

    def seen_N(t_s):
        return stribeck_N(CONTACT, np.interp(t_s - delay_s, blocks_s, block_mps))

    def slope(t_s, z):
        return np.interp(t_s, blocks_s, block_mps) * (1 - K_T * z / seen_N(t_s))

    t_s = result.t_s
    start = [stribeck_N(CONTACT, block_mps[0]) / K_T]
    z = solve_ivp(slope, (0, t_s[-1]), start, "LSODA", t_eval=t_s, rtol=1e-8, atol=1e-14, max_step=BLOCK_S).y[0]
    expected_N = K_T * z + H_T * np.interp(t_s, blocks_s, block_mps) * (1 - K_T * z / seen_N(t_s))
    later = t_s > 0.04  # the bristle has forgotten how it began
    assert result.true_friction_force_N[later] == pytest.approx(expected_N[later], abs=0.01)
    assert np.ptp(expected_N) > 1.5


@pytest.mark.parametrize("step_s", [2.5e-6, 5e-6, 1e-5, 2e-5, 5e-5])
@pytest.mark.parametrize("delay_s", [1e-5, 2.03e-3, LONGEST_LAG_S])
def test_a_dead_time_has_its_length_at_every_step(step_s, delay_s):
    params, state = build(rig({"frictional-lag": {"form": "dead-time", "delay_s": delay_s}}))
    for n in range(round(0.05 / step_s)):
        t_s = n * step_s
        late_s = t_s - late_mps(params[0], state[0], t_s, t_s)  # a speed that grows as time does
        if t_s > delay_s + 2.0 * step_s:
            assert late_s == pytest.approx(delay_s, abs=1e-9)


def test_a_lag_opens_a_loop_of_friction_over_velocity():
    """Hess & Soom: more friction while it accelerates than while it decelerates through the same velocity."""

    def loop_N(lag_s):
        result, _, _ = swinging({"lag_s": lag_s})
        v, late = result.true_velocity_mps, result.t_s > 0.1
        rising = np.gradient(v) > 0
        at = late & (np.abs(v - 5e-4) < 2e-5)
        return result.true_friction_force_N[at & rising].mean() - result.true_friction_force_N[at & ~rising].mean()

    # between two crossings of the middle the lagged velocity is apart by 2 a w lag, friction by its slope there
    slope = -2 * (CONTACT.static_force_N - CONTACT.coulomb_force_N) / 5e-4 * math.exp(-1)
    gap_N = -2 * 4e-4 * slope * TAU * 10 * 2e-3
    assert loop_N(2e-3) - loop_N(0.0) == pytest.approx(gap_N, rel=0.05)
