"""Simpler methods for comparison: each turns a result of the diagnosis into the answer that the method would have given."""

import math
from typing import Any

from bench.blind.outcomes import Opened
from diagnosis.result import PARAMETERS

Said = dict[str, Any]
# Gap that the baseline leaves on held-out runs, in noise floors, from which these methods report a gap.
# Too small: rigs without a gap get one. Too large: small effects are missed. Counted: docs/method/diagnosis.md.
_NO_GAP = 1.25


def parameters_only(case: Opened) -> Opened:
    """Refitting the rig's numbers alone: reports whether a gap remains, and names no effect."""
    return _gap_or_none(case, PARAMETERS)


def lowest_bic(case: Opened) -> Opened:
    """The single effect, or none, with the lowest Bayesian information criterion: chi2 + parameters x ln(features).

    It never answers `unexplained`. A candidate that was not refitted does not take part.
    """
    features = case.diagnosis.get("compared_features") or 0
    values = {
        candidate["effect"]: candidate["chi2"] + len(candidate.get("parameters", {})) * math.log(features)
        for candidate in case.diagnosis["candidates"]
        if candidate.get("chi2") is not None and features > 0
    }
    if not values:
        return _saying(case, {}, None)
    least = min(values.values())
    weights = {name: math.exp(-0.5 * (value - least)) for name, value in values.items()}
    total = sum(weights.values())
    probabilities = {name: weight / total for name, weight in weights.items()}
    return _saying(case, probabilities, _closed(case, max(probabilities, key=lambda name: probabilities[name])))


def told(case: Opened, shrinkage: float | None) -> Opened:
    """The true answer as a result, with the shrinkage of the true effects: the best score that a method can reach."""
    result = {
        "verdict": case.answer["verdict"],
        "effects": sorted(case.truth) if case.answer["verdict"] == "effect" else [],
        "candidates": [{"effect": name, "probability": 1.0} for name in sorted(case.truth) or ["none"]],
        "not_distinguishable": [case.answer["group"]],
        "where": [],
        "gap": {"shrinkage": shrinkage, "interval_90": None},
        "next_experiment": {},
    }
    if case.right_candidate is not None:
        result["candidates"] = [{"effect": case.right_candidate, "probability": 1.0}]
    return Opened(case.name, case.answer, result)


def _gap_or_none(case: Opened, closes: str) -> Opened:
    retuned = case.diagnosis["gap"].get("retuned")
    gap = retuned is not None and retuned > _NO_GAP
    return _saying(case, {"unexplained" if gap else "none": 1.0}, _closed(case, closes))


def _closed(case: Opened, who: str) -> Said | None:
    return next((method for method in case.diagnosis["gap"].get("compared", []) if method["who"] == who), None)


def _saying(case: Opened, probabilities: dict[str, float], closed: Said | None) -> Opened:
    top = max(probabilities, key=lambda name: probabilities[name], default="fault")
    verdict = {"none": "no-gap", "unexplained": "unexplained", "fault": "fault"}.get(top, "effect")
    gap = {key: (closed or {}).get(key) for key in ("shrinkage", "interval_90")}
    result = {
        "verdict": verdict,
        "effects": [top] if verdict == "effect" else [],
        "candidates": [{"effect": name, "probability": share} for name, share in probabilities.items()],
        "not_distinguishable": [],
        "where": [],
        "gap": gap,
        "next_experiment": {},
    }
    return Opened(case.name, case.answer, result)
