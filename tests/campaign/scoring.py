"""What a campaign amounts to. Every rate comes with its 95 % interval of Wilson."""

import math
from collections import Counter
from itertools import pairwise
from statistics import mean
from typing import Any

Case = dict[str, Any]
SHARES = (0.0, 1 / 3, 2 / 3, 1.01)  # thirds of the range of sizes
DETECTABILITIES = (0.0, 1.0, 2.0, 4.0, math.inf)  # times the detection limit


def rate(hits: list[bool]) -> dict[str, float] | None:
    """How often, of how many, with the 95 % interval; None of none."""
    n = len(hits)
    if n == 0:
        return None
    p, z = sum(hits) / n, 1.96
    middle, half = p + z * z / (2 * n), z * math.sqrt(p * (1 - p) / n + (z / (2 * n)) ** 2)
    low, high = ((middle + sign * half) / (1 + z * z / n) for sign in (-1, 1))
    return {"rate": p, "low": max(low, 0.0), "high": min(high, 1.0), "n": n}


def truth(case: Case) -> set[str]:
    return {effect["name"] for effect in case["effects"]}


def alarmed(case: Case) -> bool:
    return case["result"]["verdict"] != "no-gap"


def top(case: Case, count: int) -> list[str]:
    candidates = sorted(case["result"]["candidates"], key=lambda candidate: -candidate["probability"])
    return [candidate["effect"] for candidate in candidates[:count]]


def named_group(case: Case) -> set[str]:
    """What the tool names, with all that it says it cannot tell from that."""
    named = set(case["result"]["effects"])
    for group in case["result"]["not_distinguishable"]:
        if named & set(group):
            named = named | set(group)
    return named


def set_f1(case: Case) -> float:
    named, there = set(case["result"]["effects"]), truth(case)
    return 2.0 * len(named & there) / (len(named) + len(there))


def of_singles(cases: list[Case]) -> dict[str, Any]:
    """The scores of cases with one effect."""
    pairs = [(case, next(iter(truth(case)))) for case in cases]
    groups = [named_group(case) for case in cases if case["result"]["effects"]]
    gaps = [case["result"]["gap"]["shrinkage"] for case in cases]
    return {
        "alarm": rate([alarmed(case) for case in cases]),
        "top_1": rate([top(case, 1) == [there] for case, there in pairs]),
        "top_3": rate([there in top(case, 3) for case, there in pairs]),
        "in_group": rate([there in named_group(case) for case, there in pairs]),
        "group_size": mean(map(len, groups)) if groups else None,
        "wrong": rate([bool(named_group(case)) and there not in named_group(case) for case, there in pairs]),
        "shrinkage": mean([gap for gap in gaps if gap is not None]) if any(gap is not None for gap in gaps) else None,
    }


def score(cases: list[Case]) -> dict[str, Any]:
    """All scores, ready for JSON."""
    single = [case for case in cases if case["kind"] == "single"]
    none = [case for case in cases if case["kind"] == "none"]
    pair = [case for case in cases if case["kind"] == "pair"]
    names = sorted({name for case in single for name in truth(case)})
    confused = Counter(
        (next(iter(truth(case))), "+".join(sorted(case["result"]["effects"])) or case["result"]["verdict"])
        for case in single
    )
    measured = [case for case in single if isinstance(case.get("detectability"), int | float)]
    return {
        "cases": len(cases),
        "effects": {name: of_singles([case for case in single if truth(case) == {name}]) for name in names},
        "all_effects": of_singles(single),
        "by_size": _binned(single, SHARES, lambda case: case["effects"][0]["size_share"]),
        "by_detectability": _binned(measured, DETECTABILITIES, lambda case: case["detectability"]),
        "no_gap": {
            "false_alarms": rate([alarmed(case) for case in none]),
            "said": Counter("+".join(case["result"]["effects"]) or case["result"]["verdict"] for case in none),
            "folders": [case["folder"] for case in none if alarmed(case)],
        },
        "pairs": {
            "n": len(pair),
            "set_f1": mean(map(set_f1, pair)) if pair else None,
            "exact": rate([set(case["result"]["effects"]) == truth(case) for case in pair]),
            "one_right": rate([bool(set(case["result"]["effects"]) & truth(case)) for case in pair]),
        },
        "seconds": mean(case["result"]["elapsed_s"] for case in cases) if cases else None,
        "confusions": [[there, said, n] for (there, said), n in confused.most_common() if there != said],
    }


def _binned(cases: list[Case], edges: tuple[float, ...], value: Any) -> dict[str, Any]:
    chosen = {(low, high): [case for case in cases if low <= value(case) < high] for low, high in pairwise(edges)}
    return {f"{low:.2g} to {high:.2g}": of_singles(some) for (low, high), some in chosen.items() if some}
