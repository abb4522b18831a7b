"""Friction that varies at random, over time or along the track, whose path no prediction follows: judged by what it scatters.

Replicates of a fitted model, each under a path of its own and nothing else, give the mean and the covariance of what such paths
do to the whitened differences. With that covariance beside the noise and the priors of the nuisances, the differences have a
likelihood; its mean over a grid of sizes and lengths, against the likelihood without, is the log evidence. What the freedom of
the path costs is in the determinant: a random effect (Rasmussen & Williams, Gaussian Processes, 2006, ch. 5).
"""

import copy
import math
from typing import Final, NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from bridge.arrays import Floats
from diagnosis.features.force_drive import friction_share
from diagnosis.features.grid import BLOCK_S
from diagnosis.features.segments import CommandedRun
from diagnosis.fits.fit import Fit
from diagnosis.fits.gauss_newton import Fitter
from diagnosis.gap.measure import whitened
from diagnosis.gap.problem import Problem
from diagnosis.hypotheses.hypothesis import Coordinate, Hypothesis
from diagnosis.hypotheses.waves import friction_series

RANDOM: Final = "random"  # form
LOAD: Final = "normal-load-fluctuation"
TRACK: Final = "position-dependent-friction"
_OVER: Final = {LOAD: "time", TRACK: "position"}
RANDOM_EFFECTS: Final = tuple(_OVER)
# turns in the longest run of 10 s or so: 1, 2.5, 6 Hz; in the longest way, which is of some mm: every 5, 2, 0.8 mm
_TURNS: Final = {"time": (10.0, 25.0, 60.0), "position": (1.0, 2.5, 6.0)}
_SIZES = (0.3, 0.5, 0.7, 1.0, 1.4, 2.0)  # of the scatter that breakaways and levels show
_LEAST_RATIO = 0.005  # scatter, relative, that the paths have at least
_DRAWS = 16  # paths of each length
_INDEPENDENT = 0.3  # share of the covariance that is taken as independent, as so few draws know few correlations
_SPREAD: Final = {"ratio": 0.35, "length": 0.45}  # of the estimates, relative: the grid's
# Third and fourth standardized moment of what breakaways scatter by: 0 and 1.5 of a sine, 0 and 3 of noise. Of 12 made rigs each
# 11 with bursts of debris are beyond one of the two, 3 with a load that varies narrow-band (tests/unit/test_random_friction.py).
_ONE_SIDED, _RARE = 0.4, 3.5
_FEWEST = 8  # breakaways that tell


class Scattered(NamedTuple):
    """A model with friction that varies at random on top."""

    fit: Fit
    gained: float  # log evidence against the model without


class _Paths(NamedTuple):
    """The effect of random paths of one length on the whitened differences."""

    table: dict[str, float]  # parameters of the effect except its seed
    mean: Floats  # [compared]
    covariance: Floats  # [compared, compared]


class _TriedLoad(NamedTuple):
    """A size of the paths, and what it is worth."""

    likelihood: float
    left: float  # square of what neither paths nor nuisances explain, over the noise's variance squared
    size: float
    paths: int


class RandomFriction:
    """A random effect on the rig of a fit, by which any fit of the same problem can be judged.

    Args:
        effect: that has a random form.
        fitter: of the fitted runs.
        base: the fit whose rig the paths are drawn on, best the one that comes nearest to the runs without them.

    """

    def __init__(self, effect: str, fitter: Fitter, base: Fit) -> None:
        self.effect = effect
        self.in_bursts = effect == LOAD and in_bursts(fitter.problem)
        problem, over = fitter.problem, _OVER[effect]
        ratio = max(_scatter(problem, over), _LEAST_RATIO)
        if over == "time":
            longest_s = max(len(run.commands.drive) for run in problem.runs) * BLOCK_S
            lengths = [{"frequency_Hz": turns / longest_s} for turns in _TURNS[over]]
        else:
            longest_m = max(_way_m(run.commands) for run in problem.runs)
            lengths = [{"wavelength_m": longest_m / turns} for turns in _TURNS[over]]
        self._paths = [self._drawn(fitter, base, {"ratio": ratio} | length) for length in lengths]

    def _drawn(self, fitter: Fitter, base: Fit, table: dict[str, float]) -> _Paths:
        base_features = fitter.predicted(base.deviations, base.effects)
        paths = [{self.effect: {"form": RANDOM, "seed": seed, **table}} for seed in range(1, _DRAWS + 1)]
        shown: list[Floats] = []
        for measured in fitter.predicted_many([(base.deviations, base.effects | path) for path in paths]):
            varied = copy.copy(fitter.problem)
            varied.measured = measured + fitter.floor.bias
            shown.append(whitened(fitter.floor, varied, base_features)[0])
        drawn = np.array(shown)
        covariance = np.cov(drawn, rowvar=False)
        independent = np.diag(_INDEPENDENT * np.diag(covariance))
        return _Paths(table, drawn.mean(axis=0), (1.0 - _INDEPENDENT) * covariance + independent)

    def on(self, fit: Fit, noise: float) -> Scattered:
        """A fit with this effect on top.

        Args:
            fit: of the problem that the paths were drawn for, without this effect.
            noise: variance of whitened differences under a model that is right.

        """
        nuisances = len(fit.deviations)
        spread = np.concatenate([np.ones(nuisances), [axis.prior for axis in fit.hypothesis.coordinates]])
        # the nuisances are free about their described values, the effects about where they were fitted
        residual = fit.residual + fit.columns[:, :nuisances] @ fit.deviations
        scaled = fit.columns * spread
        without = scaled @ scaled.T + noise * np.eye(len(residual))
        tried: list[_TriedLoad] = []
        for i, paths in enumerate(self._paths):
            for size in _SIZES:
                shift = size * min(size, 1.0) * paths.mean  # what adds to powers, which count as logarithms
                tried.append(_TriedLoad(*_likelihood(without + size**2 * paths.covariance, residual - shift), size, i))
        best = max(tried)
        mean = float(np.logaddexp.reduce([attempt.likelihood for attempt in tried])) - math.log(len(tried))
        table = dict(self._paths[best.paths].table)
        table["ratio"] *= best.size
        axes = tuple(
            Coordinate(self.effect, name, scale, True, _SPREAD.get(name, _SPREAD["length"]), 0.0, math.inf)
            for name, scale in table.items()
        )
        return Scattered(
            fit._replace(
                hypothesis=Hypothesis(
                    fit.hypothesis.forms | {self.effect: RANDOM}, (*fit.hypothesis.coordinates, *axes)
                ),
                w=np.concatenate([fit.w, np.zeros(len(axes))]),
                chi2=noise**2 * best.left,
                columns=np.column_stack([fit.columns, np.zeros((len(residual), len(axes)))]),
            ),
            mean - _likelihood(without, residual)[0],
        )


def is_random(hypothesis: Hypothesis) -> bool:
    """Whether a hypothesis has an effect whose path no prediction knows."""
    return RANDOM in hypothesis.forms.values()


def in_bursts(problem: Problem) -> bool:
    """Whether breakaways scatter to one side, or most of them hardly at all; also where they are too few to tell."""
    series = [
        friction_sery.value
        for friction_sery in friction_series(problem.runs, problem.scales, "time")
        if friction_sery.of_slips
    ]
    # its own mean takes from the scatter of so few
    values = np.concatenate(
        [values_of_run * math.sqrt(len(values_of_run) / (len(values_of_run) - 1)) for values_of_run in series]
        or [np.zeros(0)]
    )
    if len(values) < _FEWEST or not values.any():
        return True
    values = values / values.std()
    return float(np.mean(values**3)) > _ONE_SIDED or float(np.mean(values**4)) > _RARE


def _scatter(problem: Problem, over: str) -> float:
    """Of the friction, relative: of breakaways and levels, on an axis of what speed and inertia leave of the force."""
    if problem.rig.drive == "force":
        shares: list[Floats] = []
        for run in problem.runs:
            assert run.commands.motion is not None, "a force drive has a motion"  # noqa: S101
            share, valid = friction_share(run.signals["drive_force_N"], run.commands.motion)
            shares.append(share[valid])
    else:
        shares = [friction_sery.value for friction_sery in friction_series(problem.runs, problem.scales, over)]
    return float(np.std(np.concatenate(shares))) if shares else 0.0


def _way_m(commands: CommandedRun) -> float:
    """How much of the track a run covers."""
    at_m = np.cumsum(commands.drive) * BLOCK_S if commands.motion is None else commands.motion.position_m
    return float(np.ptp(at_m))


def _likelihood(covariance: Floats, residual: Floats) -> tuple[float, float]:
    """Log likelihood but for a constant, and the square of the residual after its covariance was divided out."""
    factor = cho_factor(covariance, lower=True)
    explained: Floats = cho_solve(factor, residual)
    likelihood = -0.5 * float(residual @ explained) - float(np.log(np.diag(factor[0])).sum())
    return likelihood, float(explained @ explained)
