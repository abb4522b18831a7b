"""An explanation as a row of numbers: the same columns for every campaign, rig and effect.

Each evidence counts against no effect and against the best explanation. Both are compressed, as a formula that is not quite the
rig's makes evidences of thousands.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from bench.judge.linear.evidence import NOISE, of_remainder
from bench.judge.linear.witnessed import Row
from bench.judge.weighed.seen import Names, Places, Seen
from bridge.arrays import Floats
from diagnosis.hypotheses.hypothesis import LEVELS

_KNEE = 3.0  # log evidence up to which it counts in full
_BEST = 4  # single effects by each evidence, whose pairs are explanations, in addition to the promised pairs


class Table(NamedTuple):
    """The explanations of one evidence."""

    names: list[Names]  # the first is empty: no effect
    columns: Floats  # [explanations, columns]
    whole: Floats  # of the evidence as a whole, for the question whether the library explains it [whole columns]


def table_of(seen: Seen) -> Table:
    """Every explanation with its columns."""
    rows = {row.names: row for row in reversed(seen.ledger.rows)} if seen.ledger else {}
    names = _explanations(seen, rows)
    fitted, kept, freedom, relations, closed, refitted = np.array([_of_row(seen, rows, each) for each in names]).T
    evidences = [fitted, kept, relations, *(_by_place(places, names) for places in (seen.lines, seen.waves))]
    chosen = [min((_most(seen.chosen, name) for name in each), default=0.0) for each in names]
    moved = seen.ledger.moved if seen.ledger else {}
    level = [sum(abs(moved.get(LEVELS[name], 0.0)) for name in each if name in LEVELS) for each in names]
    columns = [
        *(small(values - values[0]) for values in evidences),
        *(small(values - values.max()) for values in evidences),
        small(freedom - freedom[0]), closed, refitted, small(np.array(chosen)), np.array(level),
        *(np.array([len(each) == count for each in names], np.float64) for count in (1, 2)),
    ]  # fmt: skip
    return Table(names, np.stack(columns, axis=1), _whole(seen, evidences))


def _explanations(seen: Seen, rows: dict[Names, Row]) -> list[Names]:
    """No effect, every effect, the pairs of the simulated rig, and pairs of the effects that lead in any evidence."""
    singles = [frozenset((name,)) for name in seen.possible]
    leading: set[str] = set()
    by_places: list[Callable[[str], float]] = [
        lambda name, places=places: _most(places, name) for places in (seen.lines, seen.waves, seen.chosen)
    ]
    for value in by_places:
        leading |= set(sorted((name for name in seen.possible if value(name) > 0.0), key=value)[-_BEST:])
    by_fit = sorted((row for names, row in rows.items() if len(names) == 1), key=lambda row: row.left)
    leading |= {name for row in by_fit[:_BEST] for name in row.names}
    order = sorted(leading)
    pairs = {frozenset((one, other)) for one in order for other in order if one < other}
    pairs |= {names for names in rows if len(names) == 2}
    return [frozenset(), *singles, *sorted(pairs, key=sorted)]


def _of_row(seen: Seen, rows: dict[Names, Row], names: Names) -> tuple[float, ...]:
    """Evidence of fitted and kept runs, freedom, relations, logarithm of the share that is left, whether it was refitted.

    A pair without a fit is worth as much as the better of its effects.
    """
    if seen.ledger is None or not rows:
        return 0.0, 0.0, 0.0, sum(seen.related[name] for name in names), 0.0, 0.0
    none = rows.get(frozenset(), seen.ledger.rows[0])
    alone = [rows[part] for name in names if (part := frozenset((name,))) in rows]
    row = rows.get(names) or min(alone, key=lambda row: row.left, default=none)
    fitted = of_remainder(row.left, seen.ledger.features)
    kept = of_remainder(row.kept, seen.ledger.kept_features) if seen.ledger.kept_features else 0.0
    relations = row.relations if names in rows else sum(seen.related[name] for name in names)
    closed = math.log(max(row.left, 1.0) / max(none.left, 1.0))
    return fitted, kept, row.freedom, relations, closed, float(names in rows and row.refitted)


def _by_place(places: Places, names: Sequence[Names]) -> Floats:
    """Sum over the places of the largest evidence of each explanation there, [explanations]."""
    return np.array(
        [
            sum(max((values.get(name, 0.0) for name in each), default=0.0) for values in places.values())
            for each in names
        ]
    )


def _most(places: Places, name: str) -> float:
    return max((values.get(name, 0.0) for values in places.values()), default=0.0)


def _whole(seen: Seen, evidences: Sequence[Floats]) -> Floats:
    """The remainder of the best explanation, and the size of the gap."""
    ledger = seen.ledger
    if ledger is None:
        return np.zeros(len(evidences) + 4)
    rest = [
        math.log(max(min(values), 1e-9) / (NOISE * count)) if count else 0.0
        for values, count in (
            ([row.left for row in ledger.rows if row.refitted], ledger.features),
            ([row.kept for row in ledger.rows if row.refitted], ledger.kept_features),
        )
    ]
    surface = math.log(ledger.surface[0])
    return np.array([*rest, float(ledger.kept_features > 0), surface, *(small(v.max() - v[0]) for v in evidences)])


def small(evidence: Floats) -> Floats:
    """Log evidences, compressed beyond a few."""
    return np.arcsinh(evidence / _KNEE)
