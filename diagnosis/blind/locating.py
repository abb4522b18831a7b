"""Whether the diagnosis finds the gap where the effect is, in cells of signal x regime x run.

The counterfactual of an evidence is the same rig with the same seed and without the effect. A cell is true where the evidence
differs from its counterfactual by more than 2 noise floors and the cell holds 5 % or more of the whole difference. A cell is
said where it holds 5 % or more of the gap. The bands of a cell are summed. The counterfactual is not refitted, whereas the gap
is measured from the baseline: a difference that refitting hides counts as missed.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from diagnosis.blind.outcomes import Opened

Cell = tuple[str, str, str]
_LEAST_FLOORS = 2.0
LEAST_SHARE = 0.05


def true_cells(case: Opened) -> set[Cell]:
    """The cells in which the effect shows."""
    squares = {_cell(signal, regime, run): floors**2 for signal, regime, run, floors in case.answer["cells"]}
    total = sum(squares.values())
    return {cell for cell, square in squares.items() if square > _LEAST_FLOORS**2 and square >= LEAST_SHARE * total}


def said_cells(case: Opened) -> set[Cell]:
    """The cells in which the result says that the gap is."""
    return {cell for cell, share in shares(case.said["where"]).items() if share >= LEAST_SHARE}


def shares(where: Sequence[Mapping[str, Any]]) -> Counter[Cell]:
    """Shares of the gap by cell, summed over the bands in a result's `where`."""
    found: Counter[Cell] = Counter()
    for one in where:
        found[_cell(one["signal"], one["regime"], one["run"])] += one["share"]
    return found


def f1(case: Opened) -> float | None:
    """The F1 score of the said cells against the true cells; None where the effect shows in no cell."""
    there, said = true_cells(case), said_cells(case)
    return 2.0 * len(there & said) / (len(there) + len(said)) if there else None


def _cell(signal: str, regime: str, run: str) -> Cell:
    return signal, regime, run.rsplit(".", 1)[0]
