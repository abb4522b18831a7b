"""Rigs of other kinds: the same seed makes the same evidence, every effect changes it, and no code is shared with the product."""

import ast
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from bench.blind.sealing import evidence_hash
from diagnosis.evidence.folder import load_evidence
from plant.effects.library import EFFECTS
from tests.blind import judge_sets, machines
from tests.blind.generators import Plan
from tests.blind.judge_sets import Wanted, develop, wrong_number
from tests.blind.machines import MACHINES, Machines
from tests.blind.wrong_number import EFFECT_OF


@pytest.mark.parametrize("name", MACHINES)
def test_an_evidence_follows_from_its_seed(name: str, tmp_path: Path) -> None:
    source = Machines(name)
    for folder, seed in (("a", 1), ("b", 1), ("c", 2)):
        source.make(tmp_path / folder, Plan(backbone="elasto-plastic"), seed)
    hashes = [evidence_hash(tmp_path / folder) for folder in "abc"]
    assert hashes[0] == hashes[1] != hashes[2]
    evidence = load_evidence(tmp_path / "a")
    assert [run.holdout for run in evidence.runs] == [False, False, False, True]


def test_every_effect_shows() -> None:
    source = Machines("turntable")
    for name in (*source.library, *source.outside):
        assert name in EFFECTS or name in source.outside
    random = np.random.default_rng(1)
    law = Plan(smooth=True)
    without = _forces(source, law)
    for name in (*source.library, *source.outside):
        shown = _forces(source, law._replace(effects=(source.draw(random, name),)))
        assert any(np.abs(one - other).max() > 2e-3 for one, other in zip(without, shown, strict=True)), name


def _forces(source: Machines, plan: Plan) -> list[np.ndarray]:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        source.make(Path(folder), plan, 3)
        tables = [pq.read_table(Path(folder) / f"run-0{number}.parquet") for number in (1, 2, 3, 4)]
    return [
        np.concatenate([table["drive_force_N"].to_numpy(), table["mass_position_m"].to_numpy()]) for table in tables
    ]


def test_the_generator_shares_no_code_with_plant_and_diagnosis() -> None:
    for path in Path(machines.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            assert not [name for name in names if name.split(".")[0] in {"plant", "diagnosis", "bridge"}], path


def test_a_wrong_number_is_far_from_the_right_one(tmp_path: Path) -> None:
    for seed in range(12):
        Machines("gantry").make(tmp_path, Plan(), 1)
        right = load_evidence(tmp_path).rig
        answer = wrong_number(tmp_path, np.random.default_rng(seed))
        wrong = load_evidence(tmp_path).rig
        key = answer["number"]
        away = np.expm1(abs(np.log(getattr(wrong, key) / getattr(right, key))))
        assert away > 4.0 * right.tolerance[key]
        assert wrong.model_copy(update={key: getattr(right, key)}) == right
        assert answer["effects"] in ([], [EFFECT_OF.get(key)])


def test_a_set_has_every_kind_and_finished_cases_stay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = list(judge_sets.SETS["machines"](20, 1))
    assert [one.name for one in drawn] == [f"machines-1-{number:03d}" for number in range(20)]
    made: list[str] = []

    def make(folder: Path) -> dict[str, object]:
        folder.mkdir(parents=True)
        made.append(folder.name)
        return {"kind": "none", "effects": [], "law": ""}

    few = [Wanted("one", make), Wanted("two", make)]
    monkeypatch.setitem(judge_sets.SETS, "machines", lambda _count, _seed: iter(few))
    assert list(develop(tmp_path, ["machines"], 5, 1, 1, False)) == ["one", "two"]
    assert not list(develop(tmp_path, ["machines"], 5, 1, 1, False))
    assert made == ["one", "two"]
