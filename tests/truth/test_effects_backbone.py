"""The elasto-plastic contact (Dupont et al. 2002): LuGre, but truly elastic well below breakaway."""

import math

import numpy as np
import pytest

from tests.effects_rig import TAU, rig, run, stribeck_N, towed

CONTACT = rig().contact
BREAKAWAY_N = CONTACT.static_force_N


def backbone(kind, elastic_ratio=0.7):
    pair = {"pair": "C45-C45 @ 0.063", "backbone": kind, "elastic_ratio": elastic_ratio}
    return rig(contact=pair)


def shaken_m(kind, peak):
    """Position after each 0.1 s of a force between 0.3 and `peak` of breakaway at 50 Hz."""
    blocks = np.arange(1100) * 1e-3
    mean, swing = 0.5 * (peak + 0.3), 0.5 * (peak - 0.3)
    force_N = BREAKAWAY_N * (mean + swing * np.sin(TAU * 50 * blocks)) * np.minimum(blocks / 0.1, 1.0)
    result = run(backbone(kind), force_N, force_driven=True)
    return result.true_position_m.reshape(-1, 2000).mean(axis=1)[1:]


def test_under_a_small_oscillating_load_lugre_drifts_and_this_one_does_not():
    reach_m = BREAKAWAY_N / CONTACT.stiffness_N_per_m
    drift_m = np.ptp(shaken_m("lugre", 0.65))
    assert drift_m > 0.1 * reach_m
    assert np.ptp(shaken_m("elasto-plastic", 0.65)) < 1e-4 * drift_m


def test_beyond_its_elastic_share_it_creeps_as_well():
    assert np.ptp(shaken_m("elasto-plastic", 0.95)) > 0.1 * BREAKAWAY_N / CONTACT.stiffness_N_per_m


@pytest.mark.parametrize("share", [0.3, 0.6])
def test_within_its_elastic_share_it_is_a_spring(share):
    force_N = share * BREAKAWAY_N * np.minimum(np.arange(500) / 200, 1.0)
    result = run(backbone("elasto-plastic"), force_N, force_driven=True)
    assert result.true_position_m[-1] == pytest.approx(share * BREAKAWAY_N / CONTACT.stiffness_N_per_m, rel=1e-4)


@pytest.mark.parametrize("kind", ["lugre", "elasto-plastic"])
@pytest.mark.parametrize(("share", "slides"), [(0.99, False), (1.01, True)])
def test_both_break_away_at_the_static_friction(kind, share, slides):
    force_N = share * BREAKAWAY_N * np.minimum(np.arange(1500) / 1000, 1.0)
    result = run(backbone(kind), force_N, force_driven=True)
    assert bool(result.true_position_m[-1] > 1e-3) is slides


@pytest.mark.parametrize("v_mps", [1e-4, 5e-4, 5e-3, -5e-4])
def test_both_slide_alike_when_it_is_steady(v_mps):
    result = towed({}, v_mps, 0.2, {"backbone": "elasto-plastic"})
    assert result.true_friction_force_N[-1] == pytest.approx(math.copysign(stribeck_N(CONTACT, v_mps), v_mps), rel=1e-5)


def test_stick_slip_has_the_same_range_of_force():
    def extremes_N(kind):
        result = run(backbone(kind), np.full(5000, 5e-4))
        late = result.true_drive_force_N[40_000:]
        return late.max(), late.min()

    assert extremes_N("elasto-plastic") == pytest.approx(extremes_N("lugre"), abs=0.1)
