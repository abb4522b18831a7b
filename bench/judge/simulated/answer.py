"""Names of an evidence, from its witnesses and the model that was trained on simulated rigs."""

import json
from functools import cache
from pathlib import Path
from typing import NamedTuple

from bench.judge.simulated.closer import closer
from bench.judge.simulated.inputs import NAMES, table_of, whole_of
from bench.judge.simulated.second import beside
from bench.judge.simulated.softmax import Softmax
from bench.judge.simulated.witnesses import Witnesses, baseline_of, witnesses_of
from diagnosis.evidence.folder import load_evidence
from diagnosis.gap.prepare import prepare

MODEL = Path(__file__).with_name("model.json")
NONE, OUTSIDE = "none", "outside"


class Model(NamedTuple):
    """Weights for the first effect, and for a second one."""

    first: Softmax
    second: Softmax


def answer(folder: Path, budget_s: float | None) -> dict[str, float]:  # noqa: ARG001
    """Probabilities of names, of two names together, of none and of outside; together 1."""
    evidence = load_evidence(folder)
    runs = [run for run in prepare(evidence) if not run.holdout]
    baseline, model = baseline_of(evidence.rig, runs), _model()
    witnesses = witnesses_of(evidence.rig, runs, baseline)
    alone = named_by(model.first, witnesses)
    return with_second(alone if baseline is None else closer(baseline, alone, witnesses), witnesses, model)


def with_second(alone: dict[str, float], witnesses: Witnesses, model: Model) -> dict[str, float]:
    """The probabilities of single effects shared with pairs."""
    result: dict[str, float] = {}
    for first, probability in alone.items():
        left = beside(witnesses, first)
        others = {NONE: 1.0} if left is None else named_by(model.second, left)
        for other, share in others.items():
            name = first if other in {NONE, OUTSIDE, first} else " + ".join(sorted((first, other)))
            result[name] = result.get(name, 0.0) + probability * share
    return result


def named_by(softmax: Softmax, witnesses: Witnesses, but: str = "") -> dict[str, float]:
    """Probabilities of the effects, of none and of outside; `but` is an effect that the library shall not have."""
    probabilities = softmax.probabilities(table_of(witnesses, but)[None], whole_of(witnesses, but)[None])[0]
    return dict(zip((*NAMES, NONE, OUTSIDE), probabilities.tolist(), strict=True))


@cache
def _model() -> Model:
    table = json.loads(MODEL.read_text(encoding="utf-8"))
    return Model(Softmax.read(table["first"]), Softmax.read(table["second"]))
