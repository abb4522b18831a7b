"""The contact against independent solutions: LSODA of SciPy, closed forms, and itself in finer steps."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from bridge.config import validate
from bridge.faults import Fault
from bridge.wire.channels import CHANNELS
from cockpit.paper.runs import AMPLITUDE_M, STEEL_PAIRS
from diagnosis.slips import find_cycles
from plant.config import RigConfig
from plant.contact import step
from plant.core import advance
from plant.pairs import PAIRS
from plant.records import TRUTH, build
from plant.simulate import held_velocity, run_blocks, simulate

PAIR = "C45-C45 @ 0.063"
DRIVE_MPS = 0.0005
PRINTED_DAMPING_NS_PER_M = dict(zip(STEEL_PAIRS, (2.15e4, 2.39e4, 2.07e4, 2.54e4), strict=True))


def rig(pair=PAIR, **tables):
    table = {"contact": {"pair": pair}, "piezo": {"amplitude_slew_m_per_s": 0.0}}
    return validate(RigConfig, table | tables, "test")


def coarse_rig(step_us):
    """A rig in steps of 10, 20 or 40 us: 25 samples a block are 40 us apart, a whole number of each."""
    return rig(
        piezo={"amplitude_slew_m_per_s": 0.0, "frequency_max_Hz": 1000.0},
        solver={"step_s": step_us * 1e-6, "samples_per_block": 25},
    )


def crossings_s(t_s, velocity_mps, level_mps):
    """When a velocity rises through a level, linear between samples."""
    before = np.flatnonzero((velocity_mps[:-1] < level_mps) & (velocity_mps[1:] >= level_mps))
    share = (level_mps - velocity_mps[before]) / (velocity_mps[before + 1] - velocity_mps[before])
    return t_s[before] + share * (t_s[before + 1] - t_s[before])


@pytest.fixture(scope="module")
def lsoda_slips_s():
    """When the first five slips pass ten times the drive velocity, by LSODA on the paper's equations."""
    contact, slide, drive = rig().contact, rig().slide, rig().drive
    k_t, h_t = contact.stiffness_N_per_m, contact.damping_Ns_per_m
    F_c, F_s, v_s = contact.coulomb_force_N, contact.static_force_N, contact.stribeck_velocity_mps

    def slope(t_s, state):
        x, v, z = state
        g = F_c + (F_s - F_c) * math.exp(-((v / v_s) ** 2))
        z_rate = v - k_t * abs(v) * z / g
        pull_N = drive.stiffness_N_per_m * (DRIVE_MPS * t_s - x)
        return v, (pull_N - k_t * z - h_t * z_rate) / slide.mass_kg, z_rate

    def fast(_, state):
        return state[1] - 10 * DRIVE_MPS

    fast.direction = 1.0
    # the bristle's deflection is 0.22 um at most: its tolerance has to lie far below
    solution = solve_ivp(
        slope, (0.0, 7.5), (0.0, 0.0, 0.0), "LSODA", events=fast, rtol=1e-9, atol=(1e-12, 1e-12, 1e-15)
    )
    return solution.t_events[0][:5]


def slips_s(config):
    simulation = simulate(config, 7.5)
    return crossings_s(simulation.t_s, simulation.velocity_mps, 10 * DRIVE_MPS)[:5]


def test_slips_come_within_a_fifth_of_a_millisecond_of_lsoda(lsoda_slips_s):
    assert len(lsoda_slips_s) == 5
    assert slips_s(rig()) == pytest.approx(lsoda_slips_s, abs=2e-4)


def test_the_error_falls_with_the_square_of_the_step(lsoda_slips_s):
    errors_s = [abs(slips_s(coarse_rig(step_us))[4] - lsoda_slips_s[4]) for step_us in (10, 20, 40)]
    orders = np.log2(np.divide(errors_s[1:], errors_s[:-1]))
    assert np.all((orders > 1.7) & (orders < 2.4)), (errors_s, orders)


@pytest.mark.parametrize("pair", ["C45-C45 @ 0.063", "C45-GGG40 @ 0.063"])
def test_no_slip_at_the_edge_that_is_not_real(pair):
    simulation = simulate(rig(pair), 20.0, 4000.0, AMPLITUDE_M, 8.0)
    cycles = find_cycles(simulation.t_s, simulation.drive_force_N)
    assert cycles.between(8.1, 20.0).slips == 0
    late = simulation.t_s > 8.1
    assert simulation.velocity_mps[late].max() < 2 * DRIVE_MPS


def test_a_step_too_coarse_for_the_frequency_is_refused():
    with pytest.raises(Fault) as raised:
        rig(solver={"step_s": 2e-5, "samples_per_block": 25})
    assert raised.value.kind.code == "CONFIG"
    assert "too coarse for piezo.frequency_max_Hz" in raised.value.line
    assert "1e-05" in raised.value.line


@pytest.mark.parametrize("v_r", [2e-5, 5e-4, 2e-2, -5e-4])
def test_the_bristle_follows_its_closed_form_at_constant_velocity(v_r):
    """z = z_end (1 - exp(-k_t |v_r| t / g)); a mass of 1e12 kg keeps the velocity constant."""
    contact = rig().contact
    k_t, F_c, F_s = contact.stiffness_N_per_m, contact.coulomb_force_N, contact.static_force_N
    steady_N = F_c + (F_s - F_c) * math.exp(-((v_r / 5e-4) ** 2))
    dt, z, v, before = 1e-5, 0.0, v_r, v_r
    for _ in range(500):
        g_before = steady_N
        now = v
        v, _, z = step(
            dt, dt, 0.5, 1e12, 0.0, k_t, 0.0, 0.0, steady_N, 1.0, 0.0, False, 0.0, 0.0, 0.0, v, now, z, before, g_before
        )
        before = now
    z_end = math.copysign(steady_N / k_t, v_r)
    assert z == pytest.approx(z_end * (1 - math.exp(-k_t * abs(v_r) * 500 * dt / steady_N)), rel=1e-9)


@pytest.mark.parametrize("frequency_Hz", [1000.0, 2000.0, 4000.0])
def test_the_base_vibrates_with_the_paper_s_velocity_amplitude(frequency_Hz):
    """The base accelerometer shows (2 pi f)^2 u0, v_a times 2 pi f; its own filters are opened wide here."""
    config = rig(
        solver={"step_s": 2.5e-6, "samples_per_block": 200},
        sensors={"accel_bandwidth_Hz": 1e9, "accel_lowest_Hz": 1e-6},
    )
    params, state = build(config)
    analogue, truth = np.zeros((len(CHANNELS), 200)), np.zeros((len(TRUTH), 200))
    for _ in range(5):
        advance(params, state, DRIVE_MPS, frequency_Hz, AMPLITUDE_M, analogue, truth)
    peak_mps2 = np.abs(analogue[CHANNELS.index("base_accel_mps2")]).max()
    v_a = 2 * math.pi * frequency_Hz * AMPLITUDE_M
    assert peak_mps2 / (2 * math.pi * frequency_Hz) == pytest.approx(v_a, rel=2e-3)


@pytest.mark.parametrize("pair", STEEL_PAIRS)
def test_damping_matches_table_2_and_is_critical(pair):
    numbers = PAIRS[pair]
    assert numbers["damping_Ns_per_m"] == PRINTED_DAMPING_NS_PER_M[pair]
    critical_Ns_per_m = 2 * math.sqrt(numbers["stiffness_N_per_m"] * rig(pair).slide.mass_kg)
    assert critical_Ns_per_m == pytest.approx(PRINTED_DAMPING_NS_PER_M[pair], rel=0.005)


@pytest.mark.parametrize("pair", [PAIR, "C45-PTFE @ 0.063"])
@pytest.mark.parametrize("mass_kg", [0.15, 1.5, 15.0])
def test_long_steps_of_a_slide_that_sticks_make_no_slip_and_miss_none(pair, mass_kg):
    def slips_s(long_steps):
        config = rig(pair, slide={"mass_kg": mass_kg}, drive={"profile": [[0.0, 0.0005], [9.0, 0.0005], [10.0, 0.0]]})
        params, state = build(config)
        assert params[0].steps_per_stick_sample < params[0].steps_per_sample
        if not long_steps:
            params[0].disturbed = 1
        blocks = 12_000
        analogue, truth = np.empty((len(CHANNELS), 20 * blocks)), np.empty((len(TRUTH), 20 * blocks))
        drive = held_velocity(config)(np.arange(blocks) * 1e-3)
        run_blocks(params, state, drive, np.zeros(blocks), np.zeros(blocks), analogue, truth)
        fast = truth[TRUTH.index("true_velocity_mps")] > 10 * DRIVE_MPS
        return np.flatnonzero(fast[1:] & ~fast[:-1]) * 5e-5

    found, expected = slips_s(long_steps=True), slips_s(long_steps=False)
    assert (len(found) >= 5) == (pair == PAIR)
    assert len(found) == len(expected)
    assert found == pytest.approx(expected, abs=1.5e-4)
