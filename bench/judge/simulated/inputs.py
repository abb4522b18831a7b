"""The witnesses as a table with a row for each effect: the same columns in every campaign, for every effect.

A log evidence counts by itself and against the best effect of the same place, as a formula that is not quite the rig's leaves all
evidences too large. Both are compressed: a thousand is little more than a hundred.
"""

import math

import numpy as np

from bench.judge.simulated.witnesses import Witnesses
from bridge.arrays import Floats
from diagnosis.hypotheses.hypothesis import LEVELS
from plant.effects.library import EFFECTS

NAMES = tuple(EFFECTS)
_BY_EVIDENCE = ("line", "wave", "relation", "fit")
_KNEE = 3.0  # log evidence up to which it counts in full
_CLEAR = 10.0  # of the best effect of a place, from which the others are compared with it; and lowest that counts


class Witnessed:
    """The witnesses sorted by effect; `but` is an effect that the library shall not have."""

    def __init__(self, witnesses: Witnesses, but: str = "") -> None:
        self.all = witnesses
        self.places: dict[str, list[dict[str, float]]] = {}  # log evidence by effect, at each place of a witness
        by_place: dict[tuple[str, str], dict[str, float]] = {}
        for key, value in witnesses.items():
            witness, place, what = key.split(" ", 2)
            if what in NAMES and what != but:
                by_place.setdefault((witness, place), {})[what] = value
        for (witness, _), values in by_place.items():
            self.places.setdefault(witness, []).append(values)
        self.compared = max(witnesses.get("fit rig compared", 0.0), 1.0)
        self.chi2 = max(witnesses.get("fit rig chi2", 0.0), 1.0)
        self.fit = {name: max(value, 0.0) for values in self.places.get("fit", []) for name, value in values.items()}
        self.best = max(self.fit.values(), default=0.0)
        self.first = max(self.fit, key=lambda name: self.fit[name]) if self.fit else ""
        self.beside = {
            what: value
            for key, value in witnesses.items()
            if key.startswith(f"beside {self.first} ") and (what := key.split(" ")[2]) != but
        }

    def most(self, witness: str) -> float:
        """The largest log evidence of a witness."""
        return max((max(values.values()) for values in self.places.get(witness, [])), default=0.0)


def table_of(witnesses: Witnesses, but: str = "") -> Floats:
    """Columns of each effect, [effects, columns]."""
    seen = Witnessed(witnesses, but)
    return np.array([_row(seen, name) for name in NAMES])


def _row(seen: Witnessed, name: str) -> list[float]:
    row: list[float] = []
    for witness in _BY_EVIDENCE:
        places = [values for values in seen.places.get(witness, []) if name in values]
        if not places:
            row += [0.0, 0.0, 0.0, 1.0]
            continue
        values = max(places, key=lambda values: values[name])
        best, alone = max(values.values()), max(values[name], -_CLEAR)
        row += [small(alone), small(alone - best), alone / max(best, _CLEAR), 0.0]
    lost = [values[name] for values in seen.places.get("chosen", []) if name in values]
    row.append(small(max(lost, default=0.0)))
    row.append(2.0 * seen.fit.get(name, 0.0) / seen.chi2)
    row.append(small(max(seen.beside.get(name, 0.0), 0.0)))
    row.append(abs(seen.all.get(f"moved rig {LEVELS[name]}", 0.0)) if name in LEVELS else 0.0)
    return row


def whole_of(witnesses: Witnesses, but: str = "") -> Floats:
    """Columns of the rig as a whole, [columns]: how much there is to explain, and how much one or two effects leave."""
    seen = Witnessed(witnesses, but)
    single = max(seen.chi2 - 2.0 * seen.best, 1.0)
    pair = max(single - 2.0 * max(seen.beside.values(), default=0.0), 1.0)
    row = [math.log(left / seen.compared) for left in (seen.chi2, single, pair)]
    return np.array([*row, *(small(seen.most(name)) for name in _BY_EVIDENCE), witnesses.get("moved rig surface", 0.0)])


def small(evidence: float) -> float:
    """A log evidence, compressed beyond a few."""
    return math.asinh(evidence / _KNEE)
