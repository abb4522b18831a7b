"""A tree ensemble on the same features, for comparison: a classifier that refits nothing.

The ensemble is trained on simulated rigs with rough surfaces and noise, under the commands of some evidences of the set;
nuisances and effects of the library are drawn at random. An input is the compressed distance of a feature from the described
rig, in noise floors. Inputs of different evidences are matched by name. The ensemble can answer `none`, but never `unexplained`.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from joblib import Parallel, delayed  # pyright: ignore[reportUnknownVariableType]

from bridge.arrays import Floats
from bridge.faults import Fault
from diagnosis.evidence.folder import load_evidence
from diagnosis.fits.retuning import FIRST_REPLICATES, ROUGHNESS
from diagnosis.gap.measure import Floor, compress, floor_of, replicates
from diagnosis.gap.prepare import prepare
from diagnosis.gap.problem import Draw, Problem
from diagnosis.hypotheses.catalogue import trials
from diagnosis.hypotheses.nuisances import Nuisances
from diagnosis.hypotheses.starts import Trial
from diagnosis.model.rig import Effects

Progress = Callable[[str, float], None]
Row = dict[str, float]
_TEMPLATES = 10  # number of evidences whose commands are simulated; more: more varied training, and more time
_EACH = 4  # simulated rigs per template and effect, and four times as many without an effect
_NONE = "none"  # label of a rig without an effect
_TREES = 500


class _Bench(NamedTuple):
    """One evidence as a template: its runs, the noise floor of the described rig, and names of the compared features."""

    problem: Problem
    nuisances: Nuisances
    floor: Floor
    described: Floats  # features of the described rig, predicted [features]
    names: list[str]  # names of the compared features

    def row(self, features: Floats) -> Row:
        floor = self.floor
        z = (floor.expected(features - floor.bias) - floor.expected(self.described))[floor.compared]
        z = compress(z / floor.scatter[floor.compared])
        return dict(zip(self.names, np.where(np.isfinite(z), z, 0.0).tolist(), strict=True))


def tree_probabilities(folder: Path, cases: list[str], jobs: int, progress: Progress) -> dict[str, dict[str, float]]:
    """Probabilities of the candidates, by case; `cases` must be readable.

    Raises Fault CONFIG where scikit-learn is not installed.
    """
    try:
        from sklearn.ensemble import ExtraTreesClassifier  # pyright: ignore[reportMissingImports]
    except ImportError:
        line = "--baselines: needs the package scikit-learn, which is not installed; pip install 'stickslip[dev]'"
        raise Fault("CONFIG", line) from None
    templates = cases[:: max(1, len(cases) // _TEMPLATES)][:_TEMPLATES]
    tasks = (delayed(_training)(folder / name, number) for number, name in enumerate(templates))
    made: Any = Parallel(n_jobs=jobs, return_as="generator_unordered")(tasks)
    rows: list[Row] = []
    labels: list[str] = []
    for number, (drawn, named) in enumerate(made, 1):
        rows += drawn
        labels += named
        progress(f"trees: {number} of {len(templates)} training rigs", number / len(templates))
    columns = sorted({name for row in rows for name in row})
    model: Any = ExtraTreesClassifier(_TREES, min_samples_leaf=2, class_weight="balanced", random_state=1, n_jobs=jobs)
    model.fit(_matrix(rows, columns), labels)
    asked: Any = Parallel(n_jobs=jobs)(delayed(_measured)(folder / name) for name in cases)
    given = model.predict_proba(_matrix(asked, columns)).tolist()
    return {name: dict(zip(model.classes_.tolist(), row, strict=True)) for name, row in zip(cases, given, strict=True)}


def _matrix(rows: list[Row], columns: list[str]) -> Floats:
    return np.array([[row.get(name, 0.0) for name in columns] for row in rows])


def _bench(folder: Path) -> _Bench:
    evidence = load_evidence(folder)
    problem = Problem(evidence.rig, [run for run in prepare(evidence) if not run.holdout])
    nuisances = Nuisances(evidence.rig)
    point = nuisances.point(np.zeros(len(nuisances)), {})
    floor = floor_of(problem, point, replicates(problem, point, ROUGHNESS, FIRST_REPLICATES, 1))
    names = [
        f"{file} {label.segment} {label.signal} {label.regime} {label.band_Hz} {label.name}"
        for (file, label), used in zip(problem.labels, floor.compared, strict=True)
        if used
    ]
    return _Bench(problem, nuisances, floor, problem.predicted(point), names)


def _measured(folder: Path) -> Row:
    bench = _bench(folder)
    return bench.row(bench.problem.measured)


def _training(folder: Path, number: int) -> tuple[list[Row], list[str]]:
    bench = _bench(folder)
    random = np.random.default_rng([4, number])
    by_name: dict[str, list[Trial]] = {}
    for trial in trials(bench.problem):
        by_name.setdefault(trial.hypothesis.effects[0], []).append(trial)
    rows: list[Row] = []
    labels: list[str] = []
    for name in [*by_name, *[_NONE] * 4]:
        for _ in range(_EACH):
            effects: Effects = {}
            if name != _NONE:
                candidates = by_name[name]
                effects = _drawn(random, candidates[int(random.integers(len(candidates)))])
            point = bench.nuisances.point(random.standard_normal(len(bench.nuisances)), effects)
            surface = ROUGHNESS._replace(seed=int(random.integers(1_000_000)))
            (features,) = bench.problem.predicted_many([point], [Draw(random, surface)])
            if np.isfinite(features).any():  # otherwise the draw is a rig that cannot be simulated
                rows.append(bench.row(features))
                labels.append(name)
    return rows, labels


def _drawn(random: np.random.Generator, trial: Trial) -> Effects:
    """Tables of an effect with random coordinates around the trial's start, spread by their priors."""
    coordinates = trial.hypothesis.coordinates
    w = trial.w + np.array([coordinate.prior for coordinate in coordinates]) * random.standard_normal(len(coordinates))
    return trial.hypothesis.tables(w)
