"""Train the model: `python -m bench.judge.simulated.training KEPT`; draws rigs until there are enough, 5 s of CPU each.

KEPT holds the witnesses of every rig, one JSON file each, so that a further call draws the missing rigs only.
"""

import json
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from bench.judge.simulated.answer import MODEL, NONE, OUTSIDE, Model, named_by
from bench.judge.simulated.inputs import NAMES, table_of, whole_of
from bench.judge.simulated.rigs import drawn_rig
from bench.judge.simulated.second import beside
from bench.judge.simulated.softmax import Softmax, trained
from bench.judge.simulated.witnesses import Witnesses, baseline_of, witnesses_of
from bridge.files import read_json
from bridge.results import write_json
from diagnosis.gap.prepare import prepare

_KNOWN = 0.5  # probability from which the library names an effect: without it, the rig is outside
_BEYOND = 0.15  # of the rigs have an effect that the library lacks. More: known effects are called unknown
_DIGITS = 5
Example = tuple[Witnesses, list[str], str]  # witnesses, right answer, and an effect that the library shall not have


def train(
    kept: Annotated[Path, typer.Argument(help="Folder of the witnesses of every rig.")],
    rigs: Annotated[int, typer.Option(min=100, help="Rigs to draw.")] = 600,
) -> None:
    """Draw the rigs that are missing in KEPT, and write the model."""
    kept.mkdir(parents=True, exist_ok=True)
    for seed in range(rigs):
        if not (path := kept / f"{seed}.json").exists():
            write_json(path, _example(seed))
    examples = [example for path in sorted(kept.glob("*.json")) if (example := read_json(path))]
    model = model_of([(example["witnesses"], example["effects"], "") for example in examples])
    table = {
        part: {name: np.round(values, _DIGITS).tolist() for name, values in weights._asdict().items()}
        for part, weights in model._asdict().items()
    }
    MODEL.write_text(json.dumps(table) + "\n", encoding="utf-8")


def _example(seed: int) -> dict[str, Any]:
    rig = drawn_rig(seed)
    if rig is None:
        return {}
    runs = [run for run in prepare(rig.evidence) if not run.holdout]
    baseline = baseline_of(rig.evidence.rig, runs)
    return {"effects": rig.effects, "witnesses": witnesses_of(rig.evidence.rig, runs, baseline)}


def model_of(rigs: list[Example]) -> Model:
    """The weights of both parts, from the witnesses and the effects of rigs."""
    known = _softmax(rigs)
    beyond: list[Example] = []
    second: list[Example] = []
    for witnesses, effects, _ in rigs:
        alone = named_by(known, witnesses)
        leading = max(effects, key=lambda name: alone[name]) if effects else ""
        if effects and alone[leading] > _KNOWN:
            beyond.append((witnesses, [OUTSIDE], leading))
        if left := beside(witnesses, leading):
            second.append((left, [name for name in effects if name != leading], ""))
    return Model(_softmax([*rigs, *beyond]), _softmax(second))


def _softmax(examples: list[Example]) -> Softmax:
    tables = np.array([table_of(witnesses, but) for witnesses, _, but in examples])
    wholes = np.array([whole_of(witnesses, but) for witnesses, _, but in examples])
    beyond = np.array([bool(but) for *_, but in examples])
    counts = np.where(beyond, _BEYOND / (1.0 - _BEYOND) * np.sum(~beyond) / max(np.sum(beyond), 1), 1.0)
    return trained(tables, wholes, np.array([_target(effects) for _, effects, _ in examples]), counts)


def _target(effects: list[str]) -> list[float]:
    answers = effects or [NONE]
    return [(name in answers) / len(answers) for name in (*NAMES, NONE, OUTSIDE)]


if __name__ == "__main__":
    typer.run(train)
