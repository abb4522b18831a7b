"""Find the weights: `python -m bench.judge.weighed.training KEPT`; draws rigs until there are enough, 20 s of CPU each.

KEPT holds the evidences of every rig, one JSON file each, so that a further call draws the missing rigs only.
"""

import json
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from joblib import Parallel, delayed  # pyright: ignore[reportUnknownVariableType]

from bench.judge.simulated.rigs import drawn_rig
from bench.judge.weighed.answer import WEIGHTS
from bench.judge.weighed.columns import Table, table_of
from bench.judge.weighed.seen import Seen, as_table, from_table, seen_of
from bench.judge.weighed.weights import Weights, trained
from bridge.arrays import Floats
from bridge.files import read_json
from bridge.results import write_json
from diagnosis.processes import one_thread

_KNOWN = 0.5  # probability of its effect from which a rig without this effect in the library counts as outside
_BEYOND = 0.15  # of the rigs have an effect that the library lacks. More: known effects are called unknown
_DIGITS = 5
Example = tuple[Seen, frozenset[str]]  # evidences and effects of a rig


def train(
    kept: Annotated[Path, typer.Argument(help="Folder of the evidences of every rig.")],
    rigs: Annotated[int, typer.Option(min=1, help="Rigs to draw.")] = 300,
    jobs: Annotated[int, typer.Option(min=1, help="Processes to use.")] = 1,
) -> None:
    """Draw the rigs that are missing in KEPT, and write the weights."""
    kept.mkdir(parents=True, exist_ok=True)
    missing = [seed for seed in range(rigs) if not (kept / f"{seed}.json").exists()]
    Parallel(n_jobs=jobs)(delayed(_keep)(kept / f"{seed}.json", seed) for seed in missing)
    weights = weights_of(read(kept))
    table = {name: np.round(values, _DIGITS).tolist() for name, values in weights._asdict().items()}
    WEIGHTS.write_text(json.dumps(table) + "\n", encoding="utf-8")


def read(kept: Path) -> list[Example]:
    """The kept examples."""
    tables = [read_json(path) for path in sorted(kept.glob("*.json"))]
    return [(from_table(table["seen"]), frozenset(table["effects"])) for table in tables if table]


def _keep(path: Path, seed: int) -> None:
    with one_thread():
        rig = drawn_rig(seed)
        write_json(path, {} if rig is None else {"effects": rig.effects, "seen": as_table(seen_of(rig.evidence))})


def weights_of(examples: list[Example]) -> Weights:
    """The weights, from evidences of rigs and their effects."""
    tables = [table_of(seen) for seen, _ in examples]
    targets = [_target(table, effects) for table, (_, effects) in zip(tables, examples, strict=True)]
    wholes = np.array([table.whole for table in tables])
    nobody = np.zeros(len(tables))
    known = trained(tables, targets, wholes, nobody, nobody + 1.0)
    beyond: list[Floats] = []
    for table, (seen, effects) in zip(tables, examples, strict=True):
        by_name = _of_each(known, table, effects)
        leading = max(effects, key=lambda name: by_name[name], default="")
        if leading and by_name[leading] > _KNOWN:
            beyond.append(table_of(seen.without(leading)).whole)
    outside = np.append(nobody, np.ones(len(beyond)))
    many = _BEYOND / (1.0 - _BEYOND) * len(tables) / max(len(beyond), 1)
    wholes = np.concatenate([wholes, np.array(beyond).reshape(-1, wholes.shape[1])])
    return trained(tables, targets, wholes, outside, np.where(outside > 0.0, many, 1.0))


def _of_each(weights: Weights, table: Table, effects: frozenset[str]) -> dict[str, float]:
    probabilities = weights.probabilities(table)
    return {
        name: sum(p for p, names in zip(probabilities, table.names, strict=True) if name in names) for name in effects
    }


def _target(table: Table, effects: frozenset[str]) -> Floats:
    """All on the right explanation; without it, on the largest explanations within it."""
    inside = [len(names) if names <= effects else -1 for names in table.names]
    most = np.array(inside) == max(inside)
    return most / most.sum()


if __name__ == "__main__":
    typer.run(train)
