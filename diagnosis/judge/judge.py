"""The judge: from a ledger to probabilities of all explanations, and of something that the library lacks. It has no state.

Explanations are: no effect, one effect, two effects. The log evidence of its rows is one sum. A softmax over the sums answers
which effects act. A second question, with its own probability, is whether anything else acts: a right explanation leaves noise.
"""

import math
from collections import defaultdict
from typing import Final, NamedTuple

import numpy as np
from scipy.special import expit, softmax

from bridge.arrays import Floats
from diagnosis.hypotheses.hypothesis import MASS
from diagnosis.judge.ledger import Ledger, Names

NONE: Final = "none"
# Share of the largest evidence that the error of its formula makes for other explanations; all evidence is counted in units of
# this error. Cross-validated log loss of 78 simulated rigs: 1.20; with 0.002 1.25; with 0.018 1.17, but pairs and calibration of
# development cases get worse.
ERROR: Final = 0.006
# The following numbers maximise the likelihood of the truth of these rigs: `python -m bench.judge.training`.
_WEIGHT = 0.22  # log odds of an explanation for each unit of evidence
_REFITTED = 3.68  # log odds of a fitted explanation over a promise
_PRIOR = (-1.83, -4.40)  # log odds of one and of two effects over none
# Probability that the evidence misleads: a refit in a wrong valley, a friction law that no formula has. Without: log loss 1.47.
_MISLED = 0.058
# Log odds that something else acts: with a right explanation's remainder, and for each e-fold of more, in fitted and kept runs.
_ELSE, _LEFT, _LEFT_OF_KEPT = -2.74, 0.74, 0.04
# Probability that a vibration that the library cannot make is more than a pick-up. Below a half: it alone is never reported.
_FOREIGN = 0.8


class Judged(NamedTuple):
    """The answer."""

    effects: dict[
        str, float
    ]  # probability of every effect and of NONE; the effects of a pair share its; they add up to 1
    explanations: dict[Names, float]  # probability of every explanation, the largest first; they add up to 1
    complete: float  # probability that nothing else acts

    @property
    def names(self) -> Names:
        """The effects of the most probable explanation."""
        return next(iter(self.explanations))


class Explained(NamedTuple):
    """The explanations of a ledger, and the numbers that decide between them."""

    names: list[Names]
    columns: Floats  # evidence in units of its error; 1 for a fit, for one effect, for two [explanations, 4]


def judge(ledger: Ledger) -> Judged:
    """Answer both questions."""
    names, columns = explained_by(ledger)
    values = probabilities(columns, np.array([_WEIGHT, _REFITTED, *_PRIOR]), _MISLED).tolist()
    explanations = dict(sorted(zip(names, values, strict=True), key=lambda item: -item[1]))
    effects = dict.fromkeys((NONE, *(name for name in ledger.possible if name != MASS)), 0.0)
    for names_of_one, probability in explanations.items():
        acting = names_of_one - {MASS} or {NONE}
        for name in acting:
            effects[name] += probability / len(acting)
    left, left_of_kept = remainders(ledger)
    acts = float(expit(_ELSE + _LEFT * left + _LEFT_OF_KEPT * left_of_kept))
    complete = (1.0 - acts) * (1.0 - ledger.beyond) * (1.0 - (_FOREIGN if ledger.foreign else 0.0))
    return Judged(dict(sorted(effects.items(), key=lambda item: -item[1])), explanations, complete)


def explained_by(ledger: Ledger, share_of_error: float = ERROR) -> Explained:
    """The log evidence of each explanation."""
    total: dict[Names, float] = defaultdict(float, {frozenset(): 0.0})
    total |= {frozenset((name,)): 0.0 for name in ledger.possible}
    fitted: set[Names] = set()
    for row in ledger.rows:
        names = frozenset(row.causes)
        if math.isfinite(row.evidence):
            total[names] += row.evidence
        if row.source == "fit":
            fitted.add(names)
    error = 1.0 + share_of_error * max(total.values())
    rows = [(value / error, names in fitted, len(names) == 1, len(names) == 2) for names, value in total.items()]
    return Explained(list(total), np.array(rows, np.float64))


def probabilities(columns: Floats, numbers: Floats, misled: float) -> Floats:
    """Probability of each explanation [explanations].

    Args:
        columns: of `Explained`.
        numbers: log odds for each unit of the columns [4].
        misled: probability that the evidence misleads; the priors are left then.

    """
    answer: Floats = (1.0 - misled) * softmax(columns @ numbers) + misled * softmax(columns[:, 2:] @ numbers[2:])
    return answer


def remainders(ledger: Ledger) -> tuple[float, float]:
    """The least remainder of the fitted and of the kept runs, as logarithms; 0 without any."""
    fitted, kept = (
        min((row.left for row in ledger.rows if row.source == source and row.left is not None), default=0.0)
        for source in ("fit", "kept runs")
    )
    return fitted, kept
