"""Whether the diagnosis finds the gap where the effect is, in cells of signal x regime x run.

The counterfactual of an evidence is the same rig with the same seed and without the effect. A cell is true where the evidence
differs from its counterfactual by more than 2 noise floors and the cell holds 5 % or more of the whole difference. A cell is
reported where it holds 5 % or more of the gap. The bands of a cell are summed. The counterfactual is not refitted, but the gap
is measured from the baseline: a difference that refitting hides counts as missed.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from bench.blind.outcomes import Opened

Cell = tuple[str, str, str]
_LEAST_FLOORS = 2.0  # difference in noise floors above which a cell may be true
LEAST_SHARE = 0.05  # least share of the difference in a true cell, and of the gap in a reported cell


def true_cells(case: Opened) -> set[Cell]:
    """The cells in which the effect shows."""
    squares = {_cell(signal, regime, run): floors**2 for signal, regime, run, floors in case.answer["cells"]}
    total = sum(squares.values())
    return {cell for cell, square in squares.items() if square > _LEAST_FLOORS**2 and square >= LEAST_SHARE * total}


def said_cells(case: Opened) -> set[Cell]:
    """The cells in which the result reports the gap."""
    return {cell for cell, share in shares(case.diagnosis["where"]).items() if share >= LEAST_SHARE}


def shares(where: Sequence[Mapping[str, Any]]) -> Counter[Cell]:
    """Shares of the gap by cell, summed over the bands in a result's `where`."""
    by_cell: Counter[Cell] = Counter()
    for row in where:
        by_cell[_cell(row["signal"], row["regime"], row["run"])] += row["share"]
    return by_cell


def f1(case: Opened) -> float | None:
    """The F1 score of the reported cells against the true cells; None where the effect shows in no cell."""
    true, reported = true_cells(case), said_cells(case)
    return 2.0 * len(true & reported) / (len(true) + len(reported)) if true else None


def _cell(signal: str, regime: str, run: str) -> Cell:
    return signal, regime, run.rsplit(".", 1)[0]
