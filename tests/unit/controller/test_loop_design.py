"""The amplitude loop: the margins that the design states, checked without the library that computed them."""

import subprocess
import sys

import numpy as np
import pytest

from controller.config import AmplitudeConfig
from controller.loop_design import design

BLOCK_S, TAU_S, DELAY = 1e-3, 5e-3, 2


def correction(gain, blocks, exciter_ln=-0.5, tau_s=TAU_S, delay=DELAY):
    """ln of delivered over wanted, block by block, after the exciter's gain has changed by `exciter_ln`."""
    a = np.exp(-BLOCK_S / tau_s)
    c, y = 0.0, 0.0
    delivered = [0.0] * delay
    for _ in range(blocks):
        delivered.append(c + exciter_ln)
        y = a * y + (1.0 - a) * delivered[-1 - delay]
        c -= gain * y
    return np.array(delivered[delay:])


def response(gain, frequency_Hz, tau_s=TAU_S, delay=DELAY):
    z = np.exp(2j * np.pi * frequency_Hz * BLOCK_S)
    a = np.exp(-BLOCK_S / tau_s)
    return gain / (z - 1.0) * (1.0 - a) * z / (z - a) * z**-delay


@pytest.mark.slow
@pytest.mark.parametrize(("tau_s", "delay", "wanted_deg"), [(5e-3, 2, 60), (5e-3, 6, 45), (2e-2, 1, 70)])
def test_the_phase_margin_is_what_was_asked_for(tau_s, delay, wanted_deg):
    found = design(BLOCK_S, tau_s, delay, wanted_deg)
    at_crossover = response(found.gain, found.crossover_Hz, tau_s, delay)
    assert abs(at_crossover) == pytest.approx(1.0, rel=1e-3)
    assert 180.0 + np.degrees(np.angle(at_crossover)) == pytest.approx(wanted_deg, abs=0.1)
    assert found.phase_margin_deg == pytest.approx(wanted_deg, abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(("tau_s", "delay"), [(5e-3, 2), (5e-3, 10), (1e-3, 5), (2e-2, 1)])
def test_the_gain_margin_is_where_the_loop_starts_to_oscillate(tau_s, delay):
    found = design(BLOCK_S, tau_s, delay)
    calm = correction(0.97 * found.gain_margin * found.gain, 8000, tau_s=tau_s, delay=delay)
    wild = correction(1.03 * found.gain_margin * found.gain, 8000, tau_s=tau_s, delay=delay)
    assert np.abs(calm[-500:]).max() < 1e-2
    assert np.abs(wild[-500:]).max() > 10.0


def test_a_step_settles_when_it_is_said_to():
    found = design(BLOCK_S, TAU_S, DELAY)
    left = np.abs(correction(found.gain, 500)) / 0.5
    last_outside = int(np.flatnonzero(left > 0.02)[-1])
    assert (last_outside + 1) * BLOCK_S == pytest.approx(found.settling_s, abs=1e-9)


def test_settling_does_not_depend_on_the_exciter():
    gain = design().gain
    np.testing.assert_allclose(correction(gain, 200, -2.0), 4.0 * correction(gain, 200, -0.5), rtol=1e-12)


def test_the_controller_runs_on_the_gain_that_was_designed():
    assert AmplitudeConfig().gain == pytest.approx(design(BLOCK_S, AmplitudeConfig().filter_s, DELAY).gain, rel=1e-2)


def test_loading_the_design_does_not_load_the_library():
    code = "import sys, controller.loop_design; sys.exit('control' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize(("key", "value"), [("delay_blocks", 0), ("delay_blocks", 11), ("phase_margin_deg", 90.0)])
def test_out_of_range_is_refused(key, value):
    with pytest.raises(ValueError, match=key):
        design(**{key: value})
