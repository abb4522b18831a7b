"""The linearised slider against closed forms and against the nonlinear rig, started next to steady sliding."""

import math

import numpy as np
import pytest
from scipy.special import lambertw

from bridge.config import validate
from bridge.wire.channels import CHANNELS
from cockpit.figures import stability_map as of_map
from cockpit.figures.stability_map import stability_map as draw_map
from plant.config import RigConfig
from plant.core import advance
from plant.records import TRUTH, build
from plant.simulate import simulate
from plant.stability import (
    contact,
    critical_velocity_mps,
    hurwitz_margin,
    self_sustained_velocity_mps,
    stabilising_vibration_mps,
    stability_map,
)

DRIVE_MPS = 0.0005


def rig(drive_mps=DRIVE_MPS, damping=0.0, stiffness=11700.0, pair="C45-C45 @ 0.063"):
    table = {
        "contact": {"pair": pair},
        "drive": {
            "profile": [[0.0, drive_mps]],
            "damping_Ns_per_m": damping,
            "stiffness_N_per_m": stiffness,
        },
        "piezo": {"amplitude_slew_m_per_s": 0.0},
    }
    return validate(RigConfig, table, "test")


def force_near_steady(config, duration_s, away_N, vibration_mps=0.0, frequency_Hz=5000.0):
    """Drive force less its steady mean [N], 20 samples a block, starting `away_N` from steady sliding."""
    params, state = build(config)
    s, c = state[0], config.contact
    v = config.drive.profile[0][1]
    s.z = v / float(contact(c, v, vibration_mps).relaxation_per_s)
    steady_N = c.stiffness_N_per_m * s.z
    s.v, s.v_r, s.dt_s = v, v - vibration_mps, config.solver.step_s
    s.g = c.coulomb_force_N + (c.static_force_N - c.coulomb_force_N) * math.exp(
        -((s.v_r / c.stribeck_velocity_mps) ** 2)
    )
    s.s_d = (steady_N + away_N) / config.drive.stiffness_N_per_m
    s.frequency_Hz, s.amplitude_m = frequency_Hz, vibration_mps / (2.0 * math.pi * frequency_Hz)
    samples = config.solver.samples_per_block
    analogue, truth = np.empty((len(CHANNELS), samples)), np.empty((len(TRUTH), samples))
    force_N = []
    for _ in range(round(duration_s / config.solver.block_s)):
        advance(params, state, v, frequency_Hz, float(s.amplitude_m), analogue, truth)
        force_N.append(truth[0] - steady_N)
    return np.concatenate(force_N)


def measured_growth_per_s(force_N, sample_s):
    """Slope of the logarithm of the envelope, from the peaks that are small and well above rounding."""
    size = np.abs(force_N)
    peaks = np.flatnonzero((size[1:-1] > size[:-2]) & (size[1:-1] >= size[2:])) + 1
    peaks = peaks[(size[peaks] > 1e-9) & (size[peaks] < 2e-3)][1:]
    return np.polyfit(peaks * sample_s, np.log(size[peaks]), 1)[0]


def test_contact_is_the_derivative_of_the_cycle_mean():
    c = rig().contact
    theta = (np.arange(200_000) + 0.5) / 200_000 * np.pi

    def mean(v, v_a):
        v_r = v - v_a * np.cos(theta)
        g = c.coulomb_force_N + (c.static_force_N - c.coulomb_force_N) * np.exp(-((v_r / c.stribeck_velocity_mps) ** 2))
        return np.mean(np.abs(v_r) / g)

    for v_a in (0.0, 0.4, 1.4, 40.0):
        v_a_mps, h = v_a * DRIVE_MPS, 1e-7
        at = contact(c, DRIVE_MPS, v_a_mps)
        b = mean(DRIVE_MPS, v_a_mps)
        slope = (mean(DRIVE_MPS + h, v_a_mps) - mean(DRIVE_MPS - h, v_a_mps)) / (2.0 * h)
        assert float(at.relaxation_per_s) == pytest.approx(c.stiffness_N_per_m * b, rel=1e-8)
        assert float(at.slip) == pytest.approx(1.0 - DRIVE_MPS * slope / b, abs=1e-6)


def test_without_vibration_the_slip_is_the_slope_of_the_stribeck_curve():
    c = rig().contact
    q = DRIVE_MPS / c.stribeck_velocity_mps
    drop_N = (c.static_force_N - c.coulomb_force_N) * math.exp(-q * q)
    expected = -2.0 * q * q * drop_N / (c.coulomb_force_N + drop_N)  # v g' / g
    assert float(contact(c, DRIVE_MPS, 0.0).slip) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("damping", [1.0, 10.0, 50.0])
def test_critical_velocity_meets_its_closed_form(damping):
    """The bristle relaxes within 1 ms: Hurwitz's condition becomes g'(v) = -h_d, solved by Lambert's function."""
    c = rig().contact
    relative = damping * c.stribeck_velocity_mps / (c.static_force_N - c.coulomb_force_N)
    closed_mps = c.stribeck_velocity_mps * math.sqrt(-lambertw(-0.5 * relative**2, -1).real / 2.0)
    assert critical_velocity_mps(rig(damping=damping)) == pytest.approx(closed_mps, rel=1e-3)


def test_no_damping_no_critical_velocity():
    assert critical_velocity_mps(rig()) is None
    assert self_sustained_velocity_mps(rig()) == math.inf
    force_N = simulate(rig(0.005), 6.0).drive_force_N[-60_000:]  # ten Stribeck velocities, from rest
    assert np.ptp(force_N) > 5.0


@pytest.mark.parametrize(("damping", "stiffness"), [(50.0, 11700.0), (10.0, 2000.0), (50.0, 200_000.0)])
@pytest.mark.parametrize("ratio", [0.95, 1.05])
def test_growth_near_the_critical_velocity_matches_the_rig(damping, stiffness, ratio):
    critical_mps = critical_velocity_mps(rig(damping=damping, stiffness=stiffness))
    config = rig(ratio * critical_mps, damping, stiffness)
    growth_per_s = measured_growth_per_s(force_near_steady(config, 1.0, 1e-5 if ratio < 1 else 1e-3), 5e-5)
    assert growth_per_s == pytest.approx(float(stability_map(config, ratio * critical_mps)), rel=0.05)


@pytest.mark.parametrize(("damping", "stiffness"), [(50.0, 11700.0), (10.0, 2000.0), (200.0, 11700.0)])
def test_a_fifth_below_it_slips_and_a_fifth_above_it_stays_smooth(damping, stiffness):
    critical_mps = critical_velocity_mps(rig(damping=damping, stiffness=stiffness))
    below_N = force_near_steady(rig(0.8 * critical_mps, damping, stiffness), 2.0, 1e-3)
    above_N = force_near_steady(rig(1.2 * critical_mps, damping, stiffness), 2.0, 1e-3)
    assert np.ptp(below_N[-20_000:]) > 1.0
    assert np.ptp(above_N[-4_000:]) < 1e-4


@pytest.mark.parametrize(("damping", "stiffness"), [(10.0, 11700.0), (50.0, 11700.0), (20.0, 2000.0)])
def test_stick_slip_from_rest_lasts_up_to_the_self_sustained_velocity(damping, stiffness):
    limit_mps = float(self_sustained_velocity_mps(rig(damping=damping, stiffness=stiffness)))
    slowest = [
        simulate(rig(ratio * limit_mps, damping, stiffness), 3.0).velocity_mps[-20_000:].min() / limit_mps
        for ratio in (0.9, 1.1)
    ]
    assert slowest[0] < 0.01
    assert slowest[1] > 0.5


@pytest.mark.parametrize("ratio", [0.9, 0.98, 1.02, 1.2])
def test_the_edge_of_the_vibration_is_the_rig_s(ratio):
    config = rig()
    edge_mps = stabilising_vibration_mps(config, DRIVE_MPS)
    assert edge_mps == pytest.approx(DRIVE_MPS, rel=1e-3)
    force_N = force_near_steady(config, 3.0, 0.02, ratio * edge_mps)
    swing_N = np.ptp(force_N.reshape(-1, 200).mean(axis=1)[-150:])
    assert (swing_N > 0.5) if ratio < 1.0 else (swing_N < 0.01)


def test_the_mean_s_own_decay_is_the_rig_s_at_the_set_point():
    """1.2 v_d at 5 kHz, the slowest pole 1.1 1/s; the slide's own shaking moves the mean by 0.015 N and the pole by 2 %."""
    config = rig()
    cycles_N = force_near_steady(config, 4.0, 0.2, 1.2 * DRIVE_MPS).reshape(-1, 200).mean(axis=1)
    to_go_N = cycles_N - cycles_N[-1]
    measured = np.polyfit(np.arange(10, 100) * 0.01, np.log(to_go_N[10:100]), 1)[0]
    assert measured == pytest.approx(float(stability_map(config, DRIVE_MPS, None, 1.2 * DRIVE_MPS)), rel=0.05)


def test_a_vibration_too_weak_can_unsettle_a_slide_that_was_smooth():
    config = rig(0.002, 50.0)
    assert stability_map(config, 0.002) < 0.0 < stability_map(config, 0.002, None, 0.0015)
    force_N = force_near_steady(config, 2.0, 1e-2, 0.0015)
    assert np.ptp(force_near_steady(config, 2.0, 1e-2)[-4_000:]) < 1e-4
    assert np.ptp(force_N.reshape(-1, 200).mean(axis=1)[-50:]) > 0.1


def test_the_map_grows_where_hurwitz_is_below_0():
    config = rig(damping=50.0)
    velocities, vibrations = np.array([1e-4, 5e-4, 2e-3]), np.array([0.0, 4e-4, 6e-4])
    growth = stability_map(config, velocities[:, None], None, vibrations)
    assert growth.shape == (3, 3)
    margin = hurwitz_margin(config, velocities[:, None], None, vibrations)
    np.testing.assert_array_equal(margin < 0.0, growth > 0.0)


def test_ptfe_needs_no_vibration():
    config = rig(pair="C45-PTFE @ 0.063")
    assert critical_velocity_mps(config) == 0.0
    assert stabilising_vibration_mps(config, DRIVE_MPS) == 0.0


@pytest.mark.parametrize(("drive_mps", "damping"), [(0.001, 0.0), (0.002, 50.0)])
def test_below_v_d_a_vibration_leaves_stick_slip_that_has_started(drive_mps, damping):
    """Above 1.2 v_s the linear edge lies below v_d: between the two only an undisturbed slide is smooth."""
    config = rig(drive_mps, damping)
    assert stabilising_vibration_mps(config, drive_mps) < 0.95 * drive_mps

    def swing_N(ratio):
        amplitude_m = ratio * drive_mps / (2.0 * math.pi * 5000.0)
        force_N = simulate(config, 6.0, 5000.0, amplitude_m, 2.0).drive_force_N[-20_000:]
        return np.ptp(force_N.reshape(-1, 200).mean(axis=1)[-20:])

    assert swing_N(0.95) > 0.1
    assert swing_N(1.05) < 0.05


def test_the_tail_of_the_stribeck_curve_is_a_slope_too():
    """h_d = -g'(v) far above the Stribeck velocity, where only the tail still falls: 2 d / (q^3 v_s), up to 1 / q^2."""
    config = rig(damping=0.5)
    c = config.contact.model_copy(update={"stribeck_tail": 0.4})
    drop_N, q = 0.4 * (c.static_force_N - c.coulomb_force_N), 5.0
    slope = -2.0 * drop_N * q / (1.0 + q * q) ** 2  # v_s g'
    steady_N = c.coulomb_force_N + drop_N / (1.0 + q * q)
    assert float(contact(c, q * c.stribeck_velocity_mps, 0.0).slip) == pytest.approx(q * slope / steady_N, rel=1e-6)
    found_mps = critical_velocity_mps(config.model_copy(update={"contact": c}))
    assert found_mps is not None
    q = found_mps / c.stribeck_velocity_mps
    assert q > 10.0
    assert 2.0 * drop_N * q / (1.0 + q * q) ** 2 / c.stribeck_velocity_mps == pytest.approx(0.5, rel=1e-3)


@pytest.mark.nightly
def test_the_map_of_a_rig_with_effects(tmp_path):
    """A permanent change by an effect is in the map; an effect without a place in it is reported."""
    plain = draw_map(rig(0.002, 50.0), tmp_path / "plain.png")
    effects = {
        "drive-damping": {"form": "viscous", "damping_Ns_per_m": 50.0},
        "frame-compliance": {"ratio": 0.1},
    }
    table = rig(0.002).model_dump() | {"effects": effects}
    drawn_map = draw_map(validate(RigConfig, table, "test"), tmp_path / "effects.png")
    assert drawn_map.critical_velocity_mps == plain.critical_velocity_mps
    assert drawn_map.left_out == ("frame-compliance",)
    assert "left out: frame-compliance" in drawn_map.answer


@pytest.mark.slow
def test_the_picture_and_its_numbers(tmp_path):
    result = draw_map(rig(), tmp_path / "map.png")
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")
    assert not result.stable_without_vibration
    assert result.critical_velocity_mps is None
    assert result.smallest_vibration_velocity_mps == pytest.approx(DRIVE_MPS, rel=1e-3)
    assert result.removing_vibration_velocity_mps == result.smallest_vibration_velocity_mps
    assert "stick-slip without vibration; 0.5 mm/s" in result.answer
    between = draw_map(rig(0.002, 50.0), tmp_path / "between.png")
    assert between.stable_without_vibration
    assert between.removing_vibration_velocity_mps == 0.002
    assert "a start at rest ends in stick-slip" in between.answer


def test_the_most_demanding_of_several_drive_velocities_is_reported(tmp_path, monkeypatch):
    """A damped drive at 1 mm/s sticks and slips; at 10 mm/s, to which it goes later, it does not."""
    monkeypatch.setattr(of_map, "_draw", lambda *_: None)  # 5 s of CPU, and the numbers are judged here
    profile = {"profile": [[0.0, 1e-3], [6.0, 1e-3], [6.1, 1e-2]], "damping_Ns_per_m": 50.0}
    config = validate(RigConfig, {"contact": {"pair": "C45-C45 @ 0.063"}, "drive": profile}, "test")
    result = draw_map(config, tmp_path / "map.png")
    assert result.drive_velocity_mps == 1e-3
    assert "at 1 mm/s: stick-slip without vibration" in result.answer
