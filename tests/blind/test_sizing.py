"""Sizes in detection limits: small for an effect that a refit can imitate, large for other effects."""

import numpy as np
import pytest

from tests.blind.generator import Case, draw_effect, make
from tests.blind.sizing import Bench
from tests.blind.small_set import RUNS

pytestmark = [pytest.mark.slow, pytest.mark.nightly]

SEED = 7101


@pytest.fixture(scope="module")
def detectability(tmp_path_factory):
    def evidence(*effects, roughness=0.0):
        folder = tmp_path_factory.mktemp("sized") / "rig"
        make(folder, Case(effects, roughness=roughness), SEED, RUNS)
        return folder

    bench = Bench(evidence(roughness=1.0), evidence())
    return lambda name, share: bench.detectability(
        evidence(draw_effect(np.random.default_rng(SEED), name).scaled(share))
    )


def test_an_effect_within_the_tolerances_has_a_small_detectability(detectability):
    # Coulomb friction 6.5 % lower, two of its tolerances
    assert detectability("coulomb-level", 0.4) < 1.5


def test_an_effect_beyond_the_tolerances_has_a_large_detectability(detectability):
    assert detectability("force-sensor-drift", 1.0) > 5.0
