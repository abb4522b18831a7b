"""From evidence to probabilities, lowered by how often answers of the same kind were wrong."""

import math
from typing import NamedTuple

from plant.effects.library import EFFECTS

_TEMPERATURE = 3.0  # of the probabilities: a guess


class _Mistaken(NamedTuple):
    """Shares of verdicts of one kind whose truth was something else."""

    none: float  # no gap
    unexplained: float  # an effect outside the library
    other_effect: float  # another effect of the library


# How often verdicts on two opened sets were wrong: 29 of 102 without a gap, 9 of 48 unexplained, 10 of 43 on two effects (8 had
# one right). On one effect, where nothing else came near, 2 of 134. What is too small shows no gap, an effect whose formula is
# not the library's may end as unexplained, and one that the library lacks under another's name.
_MISTAKEN_NONE = _Mistaken(0.0, 0.12, 0.17)
_MISTAKEN_UNEXPLAINED = _Mistaken(0.02, 0.0, 0.16)
_MISTAKEN_EFFECT = _Mistaken(0.0, 0.01, 0.01)
_MISTAKEN_PAIR = _Mistaken(0.0, 0.04, 0.21)
# Of 8 on development cases: what scatters may be bursts, or noise that nobody described.
_MISTAKEN_RANDOM = _Mistaken(0.0, 0.25, 0.13)
# Of a name that leaves more of the held-out runs than right ones do, on top. Of four on opened cases and measured logs two
# are right, both a slider's track.
MISTAKEN_DOUBTFUL = _Mistaken(0.0, 0.25, 0.15)


def softmax(scores: dict[str, float]) -> dict[str, float]:
    """Scores, in natural logarithms, as probabilities that add up to 1, the largest first."""
    highest = max(scores.values())
    weights = {name: math.exp((score - highest) / _TEMPERATURE) for name, score in scores.items()}
    total = sum(weights.values())
    return {name: weight / total for name, weight in sorted(weights.items(), key=lambda item: -item[1])}


def swapped(probabilities: dict[str, float], first: str, second: str) -> dict[str, float]:
    """The probabilities after an exchange between two explanations, the largest first."""
    exchanged = {first: probabilities.get(second, 0.0), second: probabilities[first]}
    return dict(sorted((probabilities | exchanged).items(), key=lambda item: -item[1]))


def mistaken_of(leaders: tuple[str, ...], random: bool) -> _Mistaken:
    """How often verdicts on these leaders were wrong; `random` says that the best model varies at random."""
    if leaders == ("none",):
        return _MISTAKEN_NONE
    if leaders == ("unexplained",):
        return _MISTAKEN_UNEXPLAINED
    if random:
        return _MISTAKEN_RANDOM
    return _MISTAKEN_EFFECT if len(leaders) == 1 else _MISTAKEN_PAIR


def with_mistakes(probabilities: dict[str, float], leaders: tuple[str, ...], mistaken: _Mistaken) -> dict[str, float]:
    """Probabilities after the leaders give away the share in which verdicts of their kind were wrong.

    Each leader gives in proportion to its lead over the best of the others, so that it stays ahead.
    """
    behind = max(value for name, value in probabilities.items() if name not in leaders)
    ahead = {name: probabilities[name] - behind for name in leaders}
    others = [name for name in EFFECTS if name not in leaders]
    given = dict.fromkeys(others, mistaken.other_effect / len(others))
    given |= {"none": mistaken.none, "unexplained": mistaken.unexplained}
    lost = sum(mistaken)
    lowered = {
        name: value + sum(ahead.values()) * given.get(name, 0.0) - ahead.get(name, 0.0) * lost
        for name, value in probabilities.items()
    }
    return dict(sorted(lowered.items(), key=lambda item: -item[1]))
