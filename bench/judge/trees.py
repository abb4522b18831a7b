"""Trees on rigs that the plant simulates under the commands of the campaign at hand: no fit, and no simulation for a case.

A rig has the library's nuisances, one effect or none, a surface of 0.1 to 3 %, and noise. Cases of one campaign share their
trees: the first case gives the commands and the starts of the segments.
"""

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bench.judge.features import features_of
from bridge.arrays import Floats
from bridge.faults import Fault
from diagnosis.evidence.folder import load_evidence
from diagnosis.features.feature import Features, Signals
from diagnosis.features.noise import RunNoise
from diagnosis.gap.prepare import Prepared, prepare
from diagnosis.gap.problem import Draw, Problem
from diagnosis.hypotheses.catalogue import trials
from diagnosis.hypotheses.nuisances import Nuisances
from diagnosis.hypotheses.starts import Trial
from diagnosis.model.rig import Effects, Roughness
from diagnosis.threads import one_thread

RIGS = 1000  # simulated rigs of a campaign, 70 s of CPU. Fewer: 406 named 18 of 24 foreign effects. More: time.
_NONE_SHARE = 0.15  # of them without an effect
_BATCH = 32
_LEAST_RIGS = 0.05  # share of the rigs that must have a feature
# Noise that is added to the features, in standard deviations, and to the logarithms of the drive's unevenness: simulated sensors
# are too alike. Without it 6 of 8 rigs without a gap get an alarm, with it 1 to 4.
_BLUR, _BLUR_OF_DRIVE = 0.2, 0.3
# Scatter along the track, and its length. Up to 0.1: a third of the effects is hidden in training.
_SURFACES, _LENGTHS_M = (1e-3, 3e-2), (2e-5, 1e-3)
# Spread of the logarithm of the noise. 0: the base's noise of another rig passed for a compliant base.
_OTHER_NOISE = 0.8


class _Aligned(Problem):
    """Runs with the features of `features_of`."""

    def _features(self, run: Prepared, signals: Signals) -> Features:
        return features_of(self.rig, run.commands, signals)


class _Trained(NamedTuple):
    """Trees of one campaign, and the labels of their inputs."""

    labels: list[tuple[str, Any]]
    model: Any
    inputs: npt.NDArray[np.bool_]  # marks the features that enough rigs have


_BY_CAMPAIGN: dict[str, _Trained] = {}


def answer(folder: Path, budget_s: float | None) -> dict[str, float]:  # noqa: ARG001
    """Probabilities of names and of none; outside is the rest of the largest. Raises Fault CONFIG without scikit-learn."""
    evidence = load_evidence(folder)
    problem = _Aligned(evidence.rig, [run for run in prepare(evidence) if not run.holdout])
    campaign = f"{problem.rig.model_dump_json()} " + " ".join(
        f"{run.file} {sorted(run.signals)} {len(run.commands.drive)} "
        f"{[segment.frequency_Hz for segment in run.commands.segments]}"
        for run in problem.runs
    )
    if campaign not in _BY_CAMPAIGN:
        _BY_CAMPAIGN[campaign] = _trained(problem)
    labels, model, inputs = _BY_CAMPAIGN[campaign]
    by_label = dict(zip(problem.labels, problem.measured.tolist(), strict=True))
    row = np.array([[by_label.get(label, math.nan) for label in labels]])
    probabilities = model.predict_proba(row[:, inputs])[0].tolist()
    return dict(zip(model.classes_.tolist(), probabilities, strict=True)) | {"outside": 1.0 - max(probabilities)}


def _trained(problem: Problem) -> _Trained:
    try:
        from sklearn.ensemble import HistGradientBoostingClassifier  # pyright: ignore[reportMissingImports]
    except ImportError:
        line = "trees: need the package scikit-learn, which is not installed; pip install 'stickslip[dev]'"
        raise Fault("CONFIG", line) from None
    rows, names = simulated(problem, RIGS, 1)
    inputs = np.isfinite(rows).mean(axis=0) > _LEAST_RIGS
    rows = rows[:, inputs]
    low, high = np.nanquantile(rows, (0.16, 0.84), axis=0)
    of_drive = np.array([label.name.startswith("drive") for _, label in problem.labels])[inputs]
    blur = np.maximum(_BLUR * (high - low) / 2.0, np.where(of_drive, _BLUR_OF_DRIVE, 0.0))
    rows = rows + blur * np.random.default_rng(1).standard_normal(rows.shape)
    model = HistGradientBoostingClassifier(
        max_iter=40, learning_rate=0.2, max_leaf_nodes=10, min_samples_leaf=6, max_features=0.1, l2_regularization=1.0,
        early_stopping=False, random_state=1,  # pyright: ignore[reportArgumentType]
    )  # fmt: skip
    # the limit of the caller does not reach a library that was loaded later: two threads took 4 minutes
    with one_thread():
        return _Trained(problem.labels, model.fit(rows, names), inputs)


def simulated(problem: Problem, count: int, seed: int) -> tuple[Floats, list[str]]:
    """Features [rigs, features] and effects of random rigs under the commands of a problem."""
    random = np.random.default_rng(seed)
    nuisances = Nuisances(problem.rig)
    by_name: dict[str, list[Trial]] = {}
    for trial in trials(problem):
        by_name.setdefault(trial.hypothesis.effects[0], []).append(trial)
    rows: list[Floats] = []
    names: list[str] = []
    measured = problem.runs
    while len(rows) < count:
        points, draws, drawn = [], [], []
        problem.runs = [run._replace(noise=_varied(random, run.noise)) for run in measured]
        for _ in range(_BATCH):
            name = "none" if random.random() < _NONE_SHARE else str(random.choice(list(by_name)))
            effects = {} if name == "none" else _effects(random, by_name[name])
            points.append(nuisances.point(random.standard_normal(len(nuisances)), effects))
            ratio, length_m = (float(np.exp(random.uniform(*np.log(limits)))) for limits in (_SURFACES, _LENGTHS_M))
            draws.append(Draw(random, Roughness(ratio, length_m, int(random.integers(1_000_000)))))
            drawn.append(name)
        for features, name in zip(problem.predicted_many(points, draws), drawn, strict=True):
            if np.isfinite(features).any():  # otherwise the plant cannot simulate such a rig
                rows.append(features)
                names.append(name)
    problem.runs = measured
    return np.array(rows), names


def _varied(random: np.random.Generator, noise: RunNoise) -> RunNoise:
    """The noise of other sensors."""

    def factor() -> float:
        return math.exp(random.normal(0.0, _OTHER_NOISE))

    pieces = {name: factor() * piece for name, piece in noise.pieces.items()}
    return noise._replace(pieces=pieces, shake_mps2={name: factor() * rms for name, rms in noise.shake_mps2.items()})


def _effects(random: np.random.Generator, tried: list[Trial]) -> Effects:
    """An effect at random coordinates around one of its starts, spread by their priors."""
    trial = tried[int(random.integers(len(tried)))]
    spread = np.array([coordinate.prior for coordinate in trial.hypothesis.coordinates])
    return trial.hypothesis.tables(trial.w + spread * random.standard_normal(len(spread)))
