"""Sizes in detection limits: nothing for what a refit can imitate, more for more."""

import numpy as np
import pytest

from tests.blind.generator import Case, draw_effect, make
from tests.blind.sizing import Bench

SEED = 7101


@pytest.fixture(scope="module")
def detectability(tmp_path_factory):
    def evidence(*effects, roughness=0.0):
        folder = tmp_path_factory.mktemp("sized") / "rig"
        make(folder, Case(effects, roughness=roughness), SEED)
        return folder

    bench = Bench(evidence(roughness=1.0), evidence())
    return lambda name, share: bench.detectability(
        evidence(draw_effect(np.random.default_rng(SEED), name).scaled(share))
    )


def test_what_the_tolerances_can_imitate_is_worth_nothing(detectability):
    assert detectability("coulomb-level", 1.0) < 0.3  # 16 % lower


def test_more_is_worth_more(detectability):
    small, large = (detectability("drive-backlash", share) for share in (0.2, 0.6))
    assert 0.3 < small < 0.7 * large
