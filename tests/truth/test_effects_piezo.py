"""Motion of the base for a command, measured by its accelerometer without filters."""

import math

import numpy as np
import pytest

from tests.effects_rig import BLOCK_S, HEAVY_KG, TAU, rig, run

AMPLITUDE_M = 2e-8
SOLVER = {"step_s": 2.5e-6, "samples_per_block": 200}


def delivered(effects, frequency_Hz):
    """Acceleration amplitude of the base over the commanded one."""
    result = run(rig(effects, solver=SOLVER), np.zeros(20), None, frequency_Hz, AMPLITUDE_M)
    late = result.base_accel_mps2[1000:]
    swing = np.exp(-1j * TAU * frequency_Hz * result.t_s[1000:])
    return 2 * abs(np.mean(late * swing)) / ((TAU * frequency_Hz) ** 2 * AMPLITUDE_M)


@pytest.mark.parametrize("frequency_Hz", [500.0, 2000.0, 5000.0])
@pytest.mark.parametrize(("form", "power"), [("first-order", 0.5), ("second-order", 1.0)])
def test_roll_off_takes_from_the_amplitude(form, power, frequency_Hz):
    effects = {"piezo-roll-off": {"form": form, "corner_Hz": 2500.0}}
    expected = (1 + (frequency_Hz / 2500.0) ** 2) ** -power
    assert delivered(effects, frequency_Hz) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("frequency_Hz", [500.0, 2900.0, 3000.0, 5000.0])
def test_the_resonance_matches_a_mass_on_a_spring(frequency_Hz):
    effects = {"piezo-resonance": {"resonance_Hz": 3000.0, "damping_ratio": 0.1}}
    r = frequency_Hz / 3000.0
    expected = 1 / abs(1 - r**2 + 2j * 0.1 * r)
    assert delivered(effects, frequency_Hz) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("frequency_Hz", [500.0, 2900.0, 3000.0, 5000.0])
@pytest.mark.parametrize("ratio", [0.15, 1.0])
def test_a_mode_takes_part_by_its_ratio(frequency_Hz, ratio):
    mode = {"form": "mode", "ratio": ratio, "resonance_Hz": 3000.0, "damping_ratio": 0.1}
    r = frequency_Hz / 3000.0
    expected = abs(1 + ratio * r**2 / (1 - r**2 + 2j * 0.1 * r))
    assert delivered({"piezo-resonance": mode}, frequency_Hz) == pytest.approx(expected, rel=1e-3)


def test_roll_off_and_resonance_multiply():
    roll_off = {"piezo-roll-off": {"corner_Hz": 2500.0}}
    resonance = {"piezo-resonance": {"resonance_Hz": 3000.0, "damping_ratio": 0.1}}
    product = delivered(roll_off, 2000.0) * delivered(resonance, 2000.0)
    assert delivered(roll_off | resonance, 2000.0) == pytest.approx(product, rel=1e-6)


def amplitude(accel, periods):
    """Of a sine at the clock of the windows, one window after another."""
    windows = accel.reshape(periods, -1)
    return np.sqrt(2 * np.mean(windows**2, axis=1))


def test_sag_under_load_goes_with_the_drive_force():
    """A heavy slide that does not move; the drive winds up to 11.7 N within half a second."""
    config = rig({"piezo-sag": {"form": "load", "ratio": 0.5}}, slide={"mass_kg": HEAVY_KG})
    result = run(config, np.full(500, 0.002), None, 1000.0, AMPLITUDE_M)
    force_N = result.true_drive_force_N.reshape(500, -1).mean(axis=1)
    expected = 1 - 0.5 * force_N / config.contact.static_force_N
    measured = amplitude(result.base_accel_mps2, 500) / ((TAU * 1000.0) ** 2 * AMPLITUDE_M)
    assert measured[1:] == pytest.approx(expected[1:], rel=2e-3)


def test_sag_under_load_takes_all_at_most():
    config = rig({"piezo-sag": {"form": "load", "ratio": 0.9}}, slide={"mass_kg": HEAVY_KG})
    result = run(config, np.full(500, 0.02), None, 1000.0, AMPLITUDE_M)
    # the high-pass forgets nothing within the run: rounding is left
    assert np.all(np.abs(result.base_accel_mps2[result.true_drive_force_N > 20.0]) < 1e-11)


def test_sag_by_heat_begins_when_the_piezo_is_switched_on():
    settling_s = 0.1
    config = rig({"piezo-sag": {"form": "heat", "ratio": 0.4, "settling_s": settling_s}})
    result = run(config, np.zeros(300), None, 1000.0, AMPLITUDE_M)
    course = 1 - 0.4 * (1 - np.exp(-(np.arange(300) + 0.5) * BLOCK_S / settling_s))
    measured = amplitude(result.base_accel_mps2, 300) / ((TAU * 1000.0) ** 2 * AMPLITUDE_M)
    assert measured == pytest.approx(course, rel=1e-3)


def test_a_pause_cools_it():
    from bridge.wire.channels import CHANNELS
    from plant.core import advance_disturbed
    from plant.records import TRUTH, build

    params, state = build(rig({"piezo-sag": {"form": "heat", "ratio": 0.4, "settling_s": 0.1}}))
    analogue, truth = np.empty((len(CHANNELS), 20)), np.empty((len(TRUTH), 20))

    def peak_mps2(blocks, amplitude_m):
        for _ in range(blocks):
            advance_disturbed(params, state, 0.0, 1000.0, amplitude_m, analogue, truth)
        return np.abs(analogue[2]).max()

    fresh = peak_mps2(1, AMPLITUDE_M)
    assert peak_mps2(500, AMPLITUDE_M) == pytest.approx(0.6 * fresh, rel=0.01)
    peak_mps2(5, 0.0)
    assert peak_mps2(1, AMPLITUDE_M) == pytest.approx(fresh, rel=1e-9)


@pytest.mark.parametrize("form", ["load", "heat"])
def test_a_sag_that_is_constant_is_the_amplitude_also_on_the_ramp(form):
    """Half of the amplitude by sag or by delivered_ratio: the same acceleration while the amplitude ramps up."""
    slow = {"amplitude_slew_m_per_s": 1e-6}
    sag = {"form": form, "ratio": 0.5}
    if form == "heat":
        sag["settling_s"] = 0.05
        start = {"vibrating_s": 1e3, "amplitude_m": 1e-10}  # warm
        effects = {"piezo-sag": sag}
    else:
        start = {"amplitude_m": 1e-10, "drive_N": 17.38, "s_d": 17.38 / 11700.0}
        effects = {"piezo-sag": sag}
    heavy = {"mass_kg": HEAVY_KG}
    sagged = run(rig(effects, piezo=slow, slide=heavy), np.zeros(20), start, 1000.0, AMPLITUDE_M)
    start.pop("vibrating_s", None)
    plain = run(rig(piezo=slow | {"delivered_ratio": 0.5}, slide=heavy), np.zeros(20), start, 1000.0, AMPLITUDE_M)
    assert sagged.base_accel_mps2 == pytest.approx(plain.base_accel_mps2, abs=1e-6)
    assert math.isclose(np.abs(plain.base_accel_mps2).max(), 0.5 * (TAU * 1000.0) ** 2 * AMPLITUDE_M, rel_tol=0.2)
