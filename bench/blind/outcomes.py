"""One opened case: the true answer, and the result of a method."""

import math
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

_MOST = 0.5  # closed share of the held-out gap from which a name counts, below it the gap counts as unexplained
_NEAR = 0.02  # relative distance within which a found number is right
# the result of a case that ended in a fault: no answer, so every score counts the case as wrong
_NOTHING_SAID: dict[str, Any] = {
    "verdict": "fault",
    "effects": [],
    "candidates": [],
    "not_distinguishable": [],
    "where": [],
    "gap": {},
    "next_experiment": {},
}


class Opened(NamedTuple):
    """Answer and result of one case; `diagnosis` has some or all keys of a diagnosis."""

    name: str
    answer: dict[str, Any]
    diagnosis: dict[str, Any]

    @property
    def stratum(self) -> str:
        """The kind of the case, such as `one-effect`."""
        return self.answer["stratum"]

    @property
    def truth(self) -> frozenset[str]:
        """Names of the effects that the rig of the case has."""
        return frozenset(effect["name"] for effect in self.answer["effects"])

    @property
    def detectability(self) -> float:
        """Size of the case's weakest effect, in detection limits; 0 without effects."""
        return min((effect["detectability"] or 0.0 for effect in self.answer["effects"]), default=0.0)

    @property
    def right_candidate(self) -> str | None:
        """The candidate that should have the whole probability; None where several are right, or a described number is wrong."""
        if self.stratum == "one-effect":
            return next(iter(self.truth))
        return {"no-gap": "none", "outside": "unexplained"}.get(self.stratum)

    @property
    def verdict(self) -> str:
        """The verdict of the result, or `fault`."""
        return self.diagnosis["verdict"]

    @property
    def told_outside(self) -> bool:
        """Whether the result reports that no known effect accounts for most of the gap."""
        if not self.named:
            return self.verdict == "unexplained"
        share = self.diagnosis["gap"].get("shrinkage")
        return self.verdict == "partly" if share is None else share < _MOST

    @property
    def number_named(self) -> bool:
        """Whether the result reports that the number whose description is wrong was described wrong."""
        return self.verdict == "described" and self._value is not None

    @property
    def number_right(self) -> bool:
        """Whether it also gives the true value of this number."""
        true = self.answer["number"]["true"]
        return self.number_named and abs((self._value or math.nan) / true - 1.0) <= _NEAR

    @property
    def _value(self) -> float | None:
        """Value that the result gives for the number whose description is wrong."""
        values = {row["name"]: row["found"] for row in self.diagnosis.get("numbers", ())}
        return values.get(self.answer["number"]["name"])

    @property
    def named(self) -> frozenset[str]:
        """Effects that the result names."""
        return frozenset(self.diagnosis["effects"])

    @property
    def group(self) -> frozenset[str]:
        """The named effects, and all effects that the result cannot separate from one of them."""
        names = set(self.named)
        for alike in self.diagnosis["not_distinguishable"]:
            if self.named & set(alike):
                names |= set(alike)
        return frozenset(names)

    @property
    def ranked(self) -> list[tuple[str, float]]:
        """Candidates, with `unexplained`, and their probabilities, the largest probability first."""
        shares = self._candidates
        if "complete" in self.diagnosis:  # diagnosis/3; in diagnosis/2 `unexplained` is a candidate
            shares = with_unexplained(self.diagnosis["candidates"], self.diagnosis["complete"])
        return sorted(shares.items(), key=lambda pair: -pair[1])

    @property
    def leading(self) -> list[str]:
        """The candidates of the result, the most probable first."""
        return sorted(self._candidates, key=lambda name: -self._candidates[name])

    @property
    def _candidates(self) -> dict[str, float]:
        return {row["effect"]: float(row["probability"] or 0.0) for row in self.diagnosis["candidates"]}

    def probability(self, name: str) -> float:
        """Probability of one candidate; 0 where the result does not list it."""
        return dict(self.ranked).get(name, 0.0)

    @property
    def set_f1(self) -> float:
        """The F1 score of the named effects against the true effects; 1 where both are empty."""
        together = len(self.named) + len(self.truth)
        return 2.0 * len(self.named & self.truth) / together if together else 1.0

    def row(self) -> dict[str, Any]:
        """The case as a row of `--json`: the true effects, and the result."""
        keys = ("name", "formula", "detectability")
        return {
            "case": self.name,
            "kind": self.stratum,
            "effects": [{key: effect.get(key) for key in keys} for effect in self.answer["effects"]],
            "number": self.answer.get("number"),
            "verdict": self.verdict,
            "named": sorted(self.named),
            "group": sorted(self.group),
            "first": [{"effect": name, "probability": probability} for name, probability in self.ranked[:3]],
            "shrinkage": self.diagnosis["gap"].get("shrinkage"),
            "gap_left": self.diagnosis["gap"].get("with_effect"),
        }


def opened(name: str, answer: dict[str, Any], result: dict[str, Any]) -> Opened:
    """A case from its answer and the content of its result file."""
    if "fault" in result:
        return Opened(name, answer, dict(_NOTHING_SAID))
    return Opened(name, answer, _NOTHING_SAID | result)


def with_unexplained(candidates: Iterable[Mapping[str, Any]], complete: float | None) -> dict[str, float]:
    """Probabilities of effects, none and `unexplained`, which add up to 1; all are 0 where nothing was judged."""
    shares = {row["effect"]: float(row["probability"] or 0.0) * (complete or 0.0) for row in candidates}
    return shares | {"unexplained": 0.0 if complete is None else 1.0 - complete}
