"""Whether the gap was found where the effect is: cells of signal x regime x run.

True are the cells in which the measured evidence differs from its counterfactual, the same rig with the same seed without the
effect, by more than 2 floors and which hold 5 % or more of the whole difference. Said are those with a share of 5 % or more of
the gap. Bands are taken together. The counterfactual is not retuned, the gap is: what tuning can hide counts as missed.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from diagnosis.blind.outcomes import Opened

Cell = tuple[str, str, str]
_LEAST_FLOORS = 2.0
LEAST_SHARE = 0.05


def true_cells(case: Opened) -> set[Cell]:
    """Where the effect shows."""
    squares = {_cell(signal, regime, run): floors**2 for signal, regime, run, floors in case.answer["cells"]}
    total = sum(squares.values())
    return {cell for cell, square in squares.items() if square > _LEAST_FLOORS**2 and square >= LEAST_SHARE * total}


def said_cells(case: Opened) -> set[Cell]:
    """Where the gap was said to be."""
    return {cell for cell, share in shares(case.said["where"]).items() if share >= LEAST_SHARE}


def shares(where: Sequence[Mapping[str, Any]]) -> Counter[Cell]:
    """Of the gap, by cell: the bands of a result's `where` together."""
    found: Counter[Cell] = Counter()
    for one in where:
        found[_cell(one["signal"], one["regime"], one["run"])] += one["share"]
    return found


def f1(case: Opened) -> float | None:
    """Of the said cells against the true ones; None where the effect shows nowhere."""
    there, said = true_cells(case), said_cells(case)
    return 2.0 * len(there & said) / (len(there) + len(said)) if there else None


def _cell(signal: str, regime: str, run: str) -> Cell:
    return signal, regime, run.rsplit(".", 1)[0]
