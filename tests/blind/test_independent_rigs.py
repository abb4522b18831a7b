"""The diagnosis on rigs whose formulas it does not know; `make blind` does it by the hundred."""

from pathlib import Path

import numpy as np
import pytest

from diagnosis.diagnose import diagnose
from diagnosis.evidence import load_evidence
from diagnosis.result import Diagnosis
from tests.blind.generator import Case, draw_effect, make


def diagnosed(folder: Path, case: Case, seed: int) -> Diagnosis:
    make(folder, case, seed)
    return diagnose(load_evidence(folder), lambda *_: None, jobs=2)


@pytest.mark.parametrize("backbone", ["lorentzian", "multi-element"])
def test_another_friction_law_is_no_gap(backbone, tmp_path):
    found = diagnosed(tmp_path, Case(backbone=backbone), 7001)
    assert found.verdict == "no-gap"
    assert found.gap.retuned < 2.0


def test_play_with_soft_edges_is_play(tmp_path):
    effect = draw_effect(np.random.default_rng(7002), "drive-backlash").scaled(0.5)
    found = diagnosed(tmp_path, Case((effect,)), 7002)
    assert found.effects == ("drive-backlash",)
    gap_m = next(one for one in found.candidates if one.effect == "drive-backlash").parameters["gap_m"]
    assert gap_m.value == pytest.approx(effect.strength * effect.numbers["backlash_m"], rel=0.3)
    # soft edges are not the library's formula: the gap on the held-out run falls, but not to the floor
    assert found.gap.with_effect < found.gap.retuned
