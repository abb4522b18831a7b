"""The gap: 1 for two runs of one plant on two rough surfaces, and larger for every effect the larger the effect is."""

from itertools import pairwise

import numpy as np
import pytest

import diagnosis.model.rig
from diagnosis.evidence.folder import load_evidence
from diagnosis.gap.measure import Floor, between, compress, differences, floor_of, gap, replicates, whitened
from diagnosis.gap.prepare import prepare
from diagnosis.gap.problem import Problem
from diagnosis.hypotheses.nuisances import Nuisances
from diagnosis.model.rig import Effects, Roughness
from diagnosis.synthetic.folder import Case
from plant.effects.library import EFFECTS
from tests.blind.plant_sizes import EFFECT_SIZES, Sizes
from tests.made_evidence import made_evidence

pytestmark = pytest.mark.slow

SURFACE = Roughness(0.003, 1.5e-4, 0)


class Bench:
    """The paper's rig in the protocol "ladder", every number as described."""

    def __init__(self) -> None:
        evidence = load_evidence(made_evidence(Case(drawn=False), seed=11))
        self.problem = Problem(evidence.rig, prepare(evidence))
        self.nuisances = Nuisances(evidence.rig)
        self.described = np.zeros(len(self.nuisances))
        self.floor: Floor = floor_of(self.problem, self.point({}), self.runs(16, 1))

    def point(self, effects: Effects):
        return self.nuisances.point(self.described, effects)

    def runs(self, count: int, seed: int):
        return replicates(self.problem, self.point({}), SURFACE, count, seed)

    def gap_to(self, predicted) -> float:
        return gap(self.floor, differences(self.floor, self.problem, predicted))


@pytest.fixture(scope="module")
def bench() -> Bench:
    return Bench()


def test_two_rough_surfaces_are_one_floor_apart(bench):
    """Runs that the floor was not made from, each as the measured one against the noise-free model."""
    measured = bench.problem.measured
    gaps = []
    for run in bench.runs(8, 2):
        bench.problem.measured = run
        gaps.append(bench.gap_to(bench.problem.predicted(bench.point({}))))
    bench.problem.measured = measured
    assert np.median(gaps) == pytest.approx(1.0, abs=0.15)
    assert max(gaps) < 1.6


def test_the_effect_of_a_slip_on_all_features_of_its_segment_counts_once(bench):
    """Among runs that the floor was not made from, along the direction in which a segment scatters most."""
    z = between(bench.floor, bench.problem.predicted(bench.point({})), bench.runs(16, 2))
    z = compress(np.where(np.isfinite(z), z, 0.0))
    z -= z.mean(axis=0)
    compared = [label for label, use in zip(bench.problem.labels, bench.floor.compared, strict=True) if use]
    segments = [(file, label.segment) for file, label in compared]
    lengths = []
    for segment in dict.fromkeys(segments):
        in_segment = np.array([one == segment for one in segments])
        main = np.linalg.svd(z[:, in_segment], full_matrices=False)[2][0]
        one_deviation = np.std(z[:, in_segment] @ main) * main
        lengths.append(np.linalg.norm(bench.floor.whitening[:, in_segment] @ one_deviation))
    assert 0.7 < np.median(lengths) < 2.0  # 3.7 where correlations between segments were taken for real
    assert max(lengths) < 3.0  # 5.6


def test_a_power_that_is_above_its_replicates_by_chance_leaves_something_of_a_weaker_one(bench):
    """A ring of 1.6 times its replicates must not leave a negative power for a ring a fifth as strong."""
    plain = bench.problem.predicted(bench.point({}))
    powers = bench.floor.powers & bench.floor.compared
    drawn = bench.runs(4, 2)
    drawn[:, powers] *= 0.6
    below = drawn.mean(axis=0) < plain
    assert (below & powers).sum() > 5
    floor = floor_of(bench.problem, bench.point({}), drawn)
    weak_rows = below & powers & floor.compared
    weak = np.where(weak_rows, 0.2 * plain, plain)
    assert floor.expected(weak)[weak_rows] == pytest.approx(0.5 * np.log(weak[weak_rows]))
    assert np.all(np.abs(between(floor, weak, plain)[weak_rows[floor.compared]]) < 4.0)


def test_slips_that_the_model_lacks_count_once_each(bench):
    """Whatever they take along: 5 floors a slip, made independent."""
    plain = bench.problem.predicted(bench.point({}))
    run = bench.problem.runs[0]
    segment = max(range(len(run.commands.segments)), key=lambda i: run.commands.segments[i].slips)
    slips = run.commands.segments[segment].slips
    of_slips = [
        file == run.file and label.segment == segment and label.regime in {"breakaway", "slip", "restick"}
        for file, label in bench.problem.labels
    ]
    measured, bench.problem.measured = bench.problem.measured, plain + bench.floor.bias  # all else is as predicted
    counted, _ = whitened(bench.floor, bench.problem, np.where(of_slips, np.nan, plain))
    apart = bench.gap_to(np.where(of_slips, np.nan, plain))
    bench.problem.measured = measured
    assert slips > 5
    assert counted @ counted == pytest.approx(25.0 * slips, rel=0.05)
    assert apart > 1.5


def test_coarse_steps_move_no_feature_by_a_third_of_a_floor(bench, monkeypatch):
    """Runs without vibration, whose steps the model chooses freely, against the plant's steps of 10 us."""
    quiet = Problem(bench.problem.rig, [run for run in bench.problem.runs if not run.commands.frequency_Hz.any()])
    files = {run.file for run in quiet.runs}
    scatter = bench.floor.scatter[[file in files for file, _ in bench.problem.labels]]
    coarse = quiet.predicted(bench.point({}))
    monkeypatch.setattr(diagnosis.model.rig, "_COARSEST_STEP_S", 1e-5)
    fine = Problem(quiet.rig, quiet.runs).predicted(bench.point({}))
    assert np.nanmax(np.abs(coarse - fine) / scatter) < 0.33


def numbers_of(name: str, sizes: Sizes, size: float) -> dict[str, float | str]:
    table: dict[str, float | str] = {"form": sizes.form, sizes.parameter: sizes.signs[-1] * size}
    for key, (low, high) in {**sizes.log, **sizes.even}.items():
        table[key] = (low * high) ** 0.5 if low > 0.0 else 0.5 * (low + high)
    for parameter in EFFECTS[name].forms[sizes.form].parameters:
        table.setdefault(parameter.name, parameter.default)
    return table


@pytest.mark.parametrize("name", list(EFFECTS))
def test_the_gap_rises_with_the_size_of_every_effect(bench, name):
    measured = bench.problem.measured
    sizes = EFFECT_SIZES[name][0]
    plain = bench.problem.predicted(bench.point({}))
    gaps = [0.0]
    for size in np.geomspace(sizes.barely, sizes.large, 4):
        effects: Effects = {name: numbers_of(name, sizes, float(size))}
        # the noise and the roughness that the floor expects are added to the rig with the effect as well
        bench.problem.measured = bench.problem.predicted(bench.point(effects)) + bench.floor.bias
        gaps.append(bench.gap_to(plain))
    bench.problem.measured = measured
    assert all(later > earlier for earlier, later in pairwise(gaps)), gaps
    assert gaps[-1] > 0.5
