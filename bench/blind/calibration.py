"""Whether the probabilities are right: of the answers at 80 %, 80 % should be right."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bench.blind.intervals import Score, bootstrapped, rate
from bench.blind.outcomes import Opened

_BINS = 5  # most bins
_FEWEST_IN_BIN = 10  # fewest cases in a bin; with fewer, chance alone makes its rate
_DRAWS = 1000  # random sets of answers for the error by chance alone


class Bin(NamedTuple):
    """Cases whose leading candidates have about the same probability."""

    probability: float  # mean probability of their leading candidates
    right: Score  # share of the cases whose leading candidate is right


def judged(cases: Sequence[Opened]) -> list[tuple[float, bool]]:
    """Probability of the leading candidate and whether it is the right one, of every case with one right answer."""
    pairs: list[tuple[float, bool]] = []
    for case in cases:
        if case.right_candidate is not None and case.ranked:
            name, probability = case.ranked[0]
            pairs.append((probability, name == case.right_candidate))
    return pairs


def reliability(pairs: Sequence[tuple[float, bool]]) -> list[Bin]:
    """Bins of equally many cases, by probability."""
    bins: list[Bin] = []
    for cases in _split(pairs):
        right = rate([hit for _, hit in cases])
        assert right is not None, "no bin is empty"  # noqa: S101
        bins.append(Bin(sum(probability for probability, _ in cases) / len(cases), right))
    return bins


def calibration_error(pairs: Sequence[tuple[float, bool]]) -> Score | None:
    """Mean over the cases of the distance, in their bin, from the mean probability to the rate of right answers."""
    error = bootstrapped(pairs, _error)
    if error is None:
        return None
    # Resampled cases are off by chance a second time, so the bootstrap's quantiles are mirrored at the value.
    low, high = 2.0 * error.value - error.high, 2.0 * error.value - error.low
    return error._replace(low=max(low, 0.0), high=max(high, error.value))


def error_of_perfect(pairs: Sequence[tuple[float, bool]]) -> Score | None:
    """The calibration error that chance alone gives so many cases if every probability is right: mean, and 95 % of draws."""
    if not pairs:
        return None
    random = np.random.default_rng(1)
    drawn = [_error([(p, bool(random.random() < p)) for p, _ in pairs]) for _ in range(_DRAWS)]
    low, high = np.quantile(drawn, (0.025, 0.975))
    return Score(float(np.mean(drawn)), float(low), float(high), len(pairs))


def _error(pairs: Sequence[tuple[float, bool]]) -> float:
    apart = 0.0
    for cases in _split(pairs):
        apart += abs(sum(probability - hit for probability, hit in cases))
    return apart / len(pairs)


def _split(pairs: Sequence[tuple[float, bool]]) -> list[list[tuple[float, bool]]]:
    # by the probability alone: sorting by the answer as well would make bins of right cases and bins of wrong cases
    ordered = sorted(pairs, key=lambda pair: pair[0])
    count = max(1, min(_BINS, len(ordered) // _FEWEST_IN_BIN))
    return [[ordered[i] for i in rows] for rows in np.array_split(np.arange(len(ordered)), count) if len(rows)]
