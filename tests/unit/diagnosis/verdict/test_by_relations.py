"""Relations correct the verdict of the contest by decided causes and by causes outside the library."""

from typing import Any

import numpy as np
import pytest

from diagnosis.fits.fit import Fit
from diagnosis.hypotheses.hypothesis import Hypothesis
from diagnosis.relations.decide import Decided, Decision, Outside
from diagnosis.relations.shares import RelationShare
from diagnosis.verdict.by_relations import with_relations_verdict
from diagnosis.verdict.judge import Verdict


def fit(*effects: str) -> Fit:
    nothing: Any = np.zeros(0)
    values: dict[str, Any] = dict.fromkeys(Fit._fields, nothing)
    return Fit(**values | {"hypothesis": Hypothesis(dict.fromkeys(effects, "form"), ())})


def verdict(kind: Any, *effects: str) -> Verdict:
    top = effects[0] if effects else {"no-gap": "none"}.get(kind, kind)
    probabilities = {top: 0.9} | {
        name: 0.02 for name in ("none", "unexplained", "force-sensor-drift", "drive-damping") if name != top
    }
    return Verdict(kind, fit(*effects) if effects else None, probabilities, None, (), 1.0)


def cause(name: str, share: float | None = None, alike: tuple[str, ...] = ()) -> Decided:
    relation_share = None if share is None else RelationShare(name, "", share, (share - 0.1, share + 0.1), 0.01)
    return Decided(name, "spring", 100.0, (name, *alike), relation_share)


OUTSIDE = Outside("spring", "in bursts", 0.046, 0.012, "N", 30.0)
DRIFT = fit("force-sensor-drift")


@pytest.mark.parametrize(
    ("before", "decision", "kind", "names"),
    [
        (verdict("effect", "drive-damping"), Decision((), (OUTSIDE,)), "unexplained", ()),
        (verdict("no-gap"), Decision((), (OUTSIDE,)), "unexplained", ()),
        (
            verdict("effect", "drive-damping"),
            Decision((cause("force-sensor-drift", 0.8),), (OUTSIDE,)),
            "partly",
            ("force-sensor-drift",),
        ),
        (verdict("no-gap"), Decision((cause("force-sensor-drift"),), ()), "effect", ("force-sensor-drift",)),
        (verdict("unexplained"), Decision((cause("force-sensor-drift"),), ()), "partly", ("force-sensor-drift",)),
        (
            verdict("effect", "drive-damping"),
            Decision((cause("force-sensor-drift"),), ()),
            "effect",
            ("force-sensor-drift",),
        ),
        (
            verdict("effect", "force-sensor-delay"),
            Decision((cause("force-sensor-lag", alike=("force-sensor-delay",)),), ()),
            "effect",
            ("force-sensor-delay",),
        ),
        (
            verdict("effect", "drive-damping", "friction-drift"),
            Decision((cause("force-sensor-drift"),), ()),
            "partly",
            ("force-sensor-drift", "friction-drift"),
        ),
        (verdict("effect", "frictional-lag"), Decision((), ()), "effect", ("frictional-lag",)),
        (verdict("no-gap"), Decision((), ()), "no-gap", ()),
    ],
)
def test_decisions_of_relations_correct_the_verdict(before, decision, kind, names):
    after = with_relations_verdict(before, decision, [DRIFT], None, None)
    assert (after.kind, after.names) == (kind, names)
    assert next(iter(after.probabilities)) == ("unexplained" if kind == "unexplained" else (*names, "none")[0])
    assert sum(after.probabilities.values()) == pytest.approx(sum(before.probabilities.values()))


@pytest.mark.parametrize(("share", "kind"), [(0.8, "partly"), (0.3, "unexplained"), (None, "unexplained")])
def test_two_effects_that_close_most_of_the_held_out_gap_stay_named_as_partly(share, kind):
    pair = fit("friction-drift", "drive-damping")
    after = with_relations_verdict(verdict("unexplained"), Decision((), ()), [], pair, share)
    assert after.kind == kind
    assert after.names == (pair.hypothesis.effects if kind == "partly" else ())
