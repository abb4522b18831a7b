"""The judge: probabilities from a ledger, without state."""

import math

from bench.judge.linear.evidence import of_remainder, shared
from bench.judge.linear.witnessed import Ledger, Row

OUTSIDE, NONE = "outside", "none"
# Log prior odds of no, one and two effects. First smaller: more alarms. Last smaller: pairs become singles.
_PRIOR = (8.0, 0.0, -4.0)

# Probability that a vibration which the library cannot make is more than a pick-up. Below a half: it alone is never outside.
_FOREIGN = 0.8


def judge(ledger: Ledger) -> dict[str, float]:
    """Probabilities of the effects and of `none`, which add up to 1, and of `outside`."""
    rows: dict[str, Row] = {}
    refitted = [row for row in ledger.rows if row.refitted]
    for row in sorted(refitted, key=lambda row: value(ledger, row)):
        rows[" + ".join(sorted(row.names)) or NONE] = row
    leading = list(rows.values())[-1]
    most = value(ledger, leading)
    weights = {name: math.exp(value(ledger, row) - most) for name, row in rows.items()}
    result = {name: weight / sum(weights.values()) for name, weight in weights.items()}
    return result | {OUTSIDE: _beyond(ledger, leading)}


def value(ledger: Ledger, row: Row) -> float:
    """Logarithm of the weight of one explanation: evidence of every witness, and the prior."""
    fitted = of_remainder(row.left, ledger.features)
    kept = of_remainder(row.kept, ledger.kept_features)
    return fitted + kept + row.freedom + row.relations + _PRIOR[len(row.names)]


def _beyond(ledger: Ledger, leading: Row) -> float:
    """Probability that the library does not explain the rig: any of three witnesses may show it.

    A remainder beyond noise is as often another friction law as an effect outside the library.
    """
    left, features = (leading.kept, ledger.kept_features) if ledger.kept_features else (leading.left, ledger.features)
    foreign = _FOREIGN if ledger.foreign else 0.0
    return 1.0 - (1.0 - 0.5 * shared(left, features)) * (1.0 - ledger.beyond) * (1.0 - foreign)
