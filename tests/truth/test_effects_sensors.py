"""Faults of the sensors: the reading against the true signal of the same run."""

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.special import gammainc

from bridge.wire.channels import CHANNELS
from bridge.wire.messages import sensor_block
from plant.core import advance_disturbed
from plant.effects.sensors import LONGEST_DELAY
from plant.records import TRUTH, build
from plant.rig.node import PlantNode
from tests.effects_rig import HEAVY_KG, TAU, rig, run

SAMPLE_S = 5e-5
STIFFNESS = 11700.0


def swinging(effects, frequency_Hz=20.0, duration_s=0.5):
    """A held slide and a drive that swings: a drive force of some 6 N +- 6 N, its velocity constant over a block."""
    config = rig(effects, slide={"mass_kg": HEAVY_KG})
    blocks_s = (np.arange(round(duration_s / 1e-3)) + 0.5) * 1e-3
    velocity_mps = 5e-4 * TAU * frequency_Hz * np.cos(TAU * frequency_Hz * blocks_s)
    return run(config, velocity_mps, {"s_d": 5e-4})


def test_without_a_fault_the_reading_is_the_force():
    result = swinging({})
    assert result.drive_force_N == pytest.approx(result.true_drive_force_N, abs=1e-9)
    assert np.ptp(result.true_drive_force_N) == pytest.approx(2 * 5e-4 * STIFFNESS, rel=0.01)


@pytest.mark.parametrize(
    ("effect", "values", "reading"),
    [
        ("gain", {"ratio": 0.07}, lambda force_N, _: 1.07 * force_N),
        ("bias", {"bias_N": -0.8}, lambda force_N, _: force_N - 0.8),
        ("drift", {"form": "linear", "rate_N_per_s": 1.5}, lambda force_N, t_s: force_N + 1.5 * t_s),
        (
            "drift",
            {"form": "settling", "drift_N": 2.0, "settling_s": 0.2},
            lambda force_N, t_s: force_N + 2.0 * (1 - np.exp(-t_s / 0.2)),
        ),
    ],
    ids=["gain", "bias", "drift, linear", "drift, settling"],
)
def test_the_reading_is_off_by_the_formula(effect, values, reading):
    result = swinging({f"force-sensor-{effect}": values})
    assert result.drive_force_N == pytest.approx(reading(result.true_drive_force_N, result.t_s), abs=1e-9)


def test_the_amplifier_does_not_change_a_bias():
    def read_N(bias_N):
        effects = {"force-sensor-bias": {"bias_N": bias_N}}
        sensors = {"force_gain": 1.1, "force_noise_N": 0.0, "force_resolution_N": 0.0}
        payload = PlantNode(rig(effects, sensors=sensors), 1).advance([])[0].payload
        return sensor_block(20).read(payload, "sensors")["drive_force_N"][0]

    assert read_N(6.0) - read_N(1.0) == pytest.approx(5.0, abs=1e-5)


def test_a_drift_is_the_sensor_s_own_and_not_amplified_by_its_gain():
    gain = {"force-sensor-gain": {"ratio": 0.5}}
    for values in ({"form": "linear", "rate_N_per_s": 1.0}, {"form": "settling", "drift_N": 1.0, "settling_s": 0.2}):
        apart_N = swinging(gain | {"force-sensor-drift": values}).drive_force_N - swinging(gain).drive_force_N
        alone_N = swinging({"force-sensor-drift": values}).drive_force_N - swinging({}).drive_force_N
        assert apart_N == pytest.approx(alone_N, abs=1e-9)


@pytest.mark.parametrize(("form", "order"), [("first-order", 1), ("second-order", 2), ("fourth-order", 4)])
def test_a_lag_steps_as_its_closed_form(form, order):
    lag_s = 4e-3
    config = rig({"force-sensor-lag": {"form": form, "lag_s": lag_s}}, slide={"mass_kg": HEAVY_KG})
    result = run(config, np.zeros(50), {"s_d": 1e-3})
    # of so many equal low-passes in a row; each but the first takes the value before it a sample early
    expected_N = STIFFNESS * 1e-3 * gammainc(order, result.t_s / lag_s)
    assert result.drive_force_N == pytest.approx(expected_N, abs=1e-6 + 0.08 * (order - 1))


@pytest.mark.parametrize(("form", "order"), [("first-order", 1), ("second-order", 2), ("fourth-order", 4)])
@pytest.mark.parametrize("frequency_Hz", [10.0, 40.0])
def test_a_lag_turns_a_sine_as_its_closed_form(form, order, frequency_Hz):
    lag_s = 2e-3
    result = swinging({"force-sensor-lag": {"form": form, "lag_s": lag_s}}, frequency_Hz)
    late = result.t_s > 0.1
    wave = np.exp(-1j * TAU * frequency_Hz * result.t_s[late])
    gain = np.mean(result.drive_force_N[late] * wave) / np.mean(result.true_drive_force_N[late] * wave)
    expected = (1 + 1j * TAU * frequency_Hz * lag_s) ** -order
    # half a sample of held input for each low-pass
    assert gain == pytest.approx(expected, abs=order * 0.6 * TAU * frequency_Hz * SAMPLE_S)


@pytest.mark.parametrize("delay_s", [0.0, 5e-5, 1e-3, 0.012])
def test_a_delay_of_whole_samples_is_exact(delay_s):
    result = swinging({"force-sensor-delay": {"delay_s": delay_s}})
    samples = round(delay_s / SAMPLE_S)
    assert np.all(result.drive_force_N[:samples] == 0.0)
    assert result.drive_force_N[samples:] == pytest.approx(
        result.true_drive_force_N[: len(result.t_s) - samples], abs=1e-9
    )


def test_a_delay_between_samples_is_linear_between_them():
    result = swinging({"force-sensor-delay": {"delay_s": 1.3e-3 + 0.25 * SAMPLE_S}})
    true_N = result.true_drive_force_N
    expected_N = lfilter([0.75, 0.25], [1.0], true_N)[1:-26]
    assert result.drive_force_N[27:] == pytest.approx(expected_N, abs=1e-9)


def test_the_longest_delay_fits_the_line_that_keeps_it():
    """At fine sampling the delay line is shorter in seconds; the configuration refuses a longer delay."""
    solver = {"step_s": 5e-6, "samples_per_block": 200}
    sample_s = 5e-6
    config = rig(
        {"force-sensor-delay": {"delay_s": LONGEST_DELAY * sample_s}}, slide={"mass_kg": HEAVY_KG}, solver=solver
    )
    result = run(config, np.full(10, 0.01))
    assert result.drive_force_N[LONGEST_DELAY:] == pytest.approx(result.true_drive_force_N[:-LONGEST_DELAY], abs=1e-9)


@pytest.mark.parametrize(("form", "mass", "base"), [("both", 1.2, 1.2), ("mass", 1.2, 1.0), ("base", 1.0, 1.2)])
def test_accelerometers_are_scaled(form, mass, base):
    def rows(effects):
        params, state = build(rig(effects))
        params[0].disturbed = 1
        analogue, truth = np.empty((len(CHANNELS), 20)), np.empty((len(TRUTH), 20))
        for _ in range(20):
            advance_disturbed(params, state, 0.005, 1000.0, 2e-8, analogue, truth)
        return analogue

    scaled, plain = rows({"accelerometer-gain": {"form": form, "ratio": 0.2}}), rows({})
    assert scaled[1] == pytest.approx(mass * plain[1], rel=1e-12)
    assert scaled[2] == pytest.approx(base * plain[2], rel=1e-12)
    assert np.abs(plain[2]).max() > 0.5
