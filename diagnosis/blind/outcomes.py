"""One case opened: what is true of it, and what a method said."""

from typing import Any, NamedTuple

OTHER_NAMES = ("none", "unexplained")
# what a case that ended in a fault has said: nothing, and nothing is right about it
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
    """Answer and result of one case; `said` has the form of `diagnosis/1` or of a part of it."""

    name: str
    answer: dict[str, Any]
    said: dict[str, Any]

    @property
    def stratum(self) -> str:
        """The kind of case."""
        return self.answer["stratum"]

    @property
    def truth(self) -> frozenset[str]:
        """Names of the effects that are there."""
        return frozenset(effect["name"] for effect in self.answer["effects"])

    @property
    def detectability(self) -> float:
        """Of the weakest effect, in detection limits; 0 without effects."""
        return min((effect["detectability"] or 0.0 for effect in self.answer["effects"]), default=0.0)

    @property
    def right_candidate(self) -> str | None:
        """The one candidate that should have the probability; None where several would be right, or nobody knows."""
        if self.stratum in {"indistinguishable", "real-log"}:
            return None
        if self.answer["verdict"] == "effect":
            return next(iter(self.truth)) if len(self.truth) == 1 else None
        return "none" if self.answer["verdict"] == "no-gap" else "unexplained"

    @property
    def verdict(self) -> str:
        """What was said: effect, no-gap, unexplained, or fault."""
        return self.said["verdict"]

    @property
    def named(self) -> frozenset[str]:
        """Effects that were named."""
        return frozenset(self.said["effects"])

    @property
    def group(self) -> frozenset[str]:
        """What was named, with all that was said not to be told apart from it."""
        found = set(self.named)
        for alike in self.said["not_distinguishable"]:
            if self.named & set(alike):
                found |= set(alike)
        return frozenset(found)

    @property
    def ranked(self) -> list[tuple[str, float]]:
        """Candidates and their probabilities, the most probable first."""
        found = [(one["effect"], float(one["probability"] or 0.0)) for one in self.said["candidates"]]
        return sorted(found, key=lambda one: -one[1])

    def probability(self, name: str) -> float:
        """Of one candidate; 0 where nothing was said of it."""
        return dict(self.ranked).get(name, 0.0)

    @property
    def set_f1(self) -> float:
        """Of the named effects against those that are there."""
        together = len(self.named) + len(self.truth)
        return 2.0 * len(self.named & self.truth) / together if together else 1.0

    def row(self) -> dict[str, Any]:
        """What is there and what was said of it, for `--json`."""
        keys = ("name", "formula", "detectability")
        return {
            "case": self.name,
            "kind": self.stratum,
            "effects": [{key: effect.get(key) for key in keys} for effect in self.answer["effects"]],
            "channels_left_out": self.answer["leave_out"],
            "verdict": self.verdict,
            "named": sorted(self.named),
            "group": sorted(self.group),
            "first": [{"effect": name, "probability": probability} for name, probability in self.ranked[:3]],
            "shrinkage": self.said["gap"].get("shrinkage"),
            "gap_left": self.said["gap"].get("with_effect"),
        }


def opened(name: str, answer: dict[str, Any], result: dict[str, Any]) -> Opened:
    """A case with what is in its result file."""
    return Opened(name, answer, _NOTHING_SAID | result if "fault" not in result else dict(_NOTHING_SAID))
