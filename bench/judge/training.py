"""The numbers of the judge from simulated rigs: `python -m bench.judge.training KEPT` prints them for `diagnosis/judge/judge.py`.

KEPT holds the ledger of every rig, one JSON file each, 20 s of CPU; a further call draws the missing rigs only.
"""

import math
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import typer
from joblib import Parallel, delayed  # pyright: ignore[reportUnknownVariableType]
from scipy.optimize import minimize
from scipy.special import expit

from bench.judge.rigs import drawn_rig
from bridge.arrays import Floats
from bridge.files import read_json
from bridge.results import strict_json, write_json
from diagnosis.judge.judge import ERROR, Explained, explained_by, probabilities, remainders
from diagnosis.judge.ledger import Ledger, Names
from diagnosis.judge.witnesses import before_fits, ledger_of, with_fits
from diagnosis.result import LedgerRow
from diagnosis.threads import one_thread

_HELD = 1e-3  # penalty on squares of the numbers. Larger: they stay near 0. Smaller: chance is learned from few rigs
_KNOWN = 0.5  # probability of its effect from which a rig without this effect in the library counts as outside
# Evidence of the truth from which an effect is visible, and of anything else from which a rig misleads and is kept.
_SEEN, _MISLEADS = 2.0, 10.0
_FOLDS = 10  # of the cross-validation
_BEYOND = 0.15  # of the rigs have an effect that the library lacks. More: known effects are called unknown


class Example(NamedTuple):
    """A rig."""

    ledger: Ledger
    effects: frozenset[str]


class Numbers(NamedTuple):
    """The numbers of the judge."""

    explanations: Floats  # _WEIGHT, _REFITTED, and _PRIOR of one and two effects
    misled: float  # _MISLED
    something_else: Floats  # _ELSE, _LEFT, _LEFT_OF_KEPT


def train(
    kept: Annotated[Path, typer.Argument(help="Folder of the ledgers of every rig.")],
    rigs: Annotated[int, typer.Option(min=1, help="Rigs to draw.")] = 300,
    jobs: Annotated[int, typer.Option(min=1, help="Processes to use.")] = 1,
) -> None:
    """Draw the rigs that are missing in KEPT, and print the numbers."""
    kept.mkdir(parents=True, exist_ok=True)
    missing = [seed for seed in range(rigs) if not (kept / f"{seed}.json").exists()]
    Parallel(n_jobs=jobs)(delayed(keep)(kept / f"{seed}.json", seed) for seed in missing)
    examples = read(kept)
    numbers = numbers_of(examples)
    typer.echo(f"{len(examples)} rigs with a visible effect or none")
    typer.echo("_WEIGHT, _REFITTED, _PRIOR = " + ", ".join(f"{value:.2f}" for value in numbers.explanations))
    typer.echo(f"_MISLED = {numbers.misled:.3f}")
    typer.echo(
        f"log loss, cross-validated: {log_loss(examples):.2f}; without misleading {log_loss(examples, misleads=False):.2f}"
    )
    for error in (0.0, 0.3 * ERROR, 3.0 * ERROR):
        typer.echo(f"with {error:.3f} as ERROR: {log_loss(examples, error):.2f}")
    typer.echo("_ELSE, _LEFT, _LEFT_OF_KEPT = " + ", ".join(f"{value:.2f}" for value in numbers.something_else))


def keep(path: Path, seed: int) -> None:
    """Draw one rig and write its ledger."""
    rig = drawn_rig(seed)
    if rig is None:
        write_json(path, {})
        return
    with one_thread():
        ledger = ledger_of(with_fits(before_fits(rig.evidence, 1, math.inf), _no_report))
    write_json(path, {"effects": rig.effects, "ledger": strict_json(ledger)})


def read(kept: Path) -> list[Example]:
    """The kept rigs whose effect, if any, is visible."""
    tables = [read_json(path) for path in sorted(kept.glob("*.json"))]
    examples = [Example(from_json(table["ledger"]), frozenset(table["effects"])) for table in tables if table]
    return [example for example in examples if _visible(example)]


def from_json(table: dict[str, Any]) -> Ledger:
    """A ledger from its JSON."""
    rows: list[LedgerRow] = []
    for row in table["rows"]:
        evidence = math.nan if row["evidence"] is None else row["evidence"]
        rows.append(LedgerRow(**(row | {"causes": tuple(row["causes"]), "evidence": evidence})))
    return Ledger(tuple(rows), tuple(table["possible"]), table["beyond"], table["foreign"])


def numbers_of(examples: list[Example]) -> Numbers:
    """The numbers of the highest likelihood."""
    explained = [explained_by(example.ledger) for example in examples]
    numbers, misled = _of_explanations(explained, _targets(explained, examples))
    lacks = [
        without
        for example, each in zip(examples, explained, strict=True)
        if (without := _without_its_effect(example, each.names, probabilities(each.columns, numbers, misled)))
        is not None
    ]
    rows = np.array([(1.0, *remainders(ledger)) for ledger in (*(example.ledger for example in examples), *lacks)])
    outside = np.repeat([0.0, 1.0], [len(examples), len(lacks)])
    many = _BEYOND / (1.0 - _BEYOND) * len(examples) / max(len(lacks), 1)
    counts = np.where(outside > 0.0, many, 1.0) / (len(examples) / (1.0 - _BEYOND))

    def loss_of_else(odds: Floats) -> float:
        scores = rows @ odds
        return float(counts @ (np.logaddexp(0.0, scores) - outside * scores)) + 0.5 * _HELD * float(odds[1:] @ odds[1:])

    return Numbers(numbers, misled, minimize(loss_of_else, np.zeros(3)).x)


def log_loss(examples: list[Example], error: float = ERROR, *, misleads: bool = True) -> float:
    """Mean of - log(probability of the truth) of every rig, by the numbers from the other folds.

    Args:
        examples: rigs.
        error: share of the largest evidence that its error makes, as `diagnosis.judge.judge.ERROR`.
        misleads: whether the evidence may mislead.

    """
    explained = [explained_by(example.ledger, error) for example in examples]
    targets = _targets(explained, examples)
    losses: list[float] = []
    for fold in range(_FOLDS):
        others = [i for i in range(len(examples)) if i % _FOLDS != fold]
        numbers, misled = _of_explanations(
            [explained[i] for i in others], [targets[i] for i in others], misleads=misleads
        )
        mine = slice(fold, None, _FOLDS)
        losses += _losses(explained[mine], targets[mine], numbers, misled)
    return float(np.mean(losses))


def _of_explanations(
    explained: list[Explained], targets: list[Floats], *, misleads: bool = True
) -> tuple[Floats, float]:
    """The numbers of the explanations [4], and the probability that the evidence misleads."""

    def misled_at(at: Floats) -> float:
        return float(expit(at[-1])) if misleads else 0.0

    def loss(at: Floats) -> float:
        of_rigs = _losses(explained, targets, at[:-1], misled_at(at))
        return float(np.mean(of_rigs)) + 0.5 * _HELD * float(at[:-1] @ at[:-1])

    at = minimize(loss, np.array([0.3, 1.0, -1.0, -3.0, -2.5])).x
    return at[:-1], misled_at(at)


def _losses(explained: list[Explained], targets: list[Floats], numbers: Floats, misled: float) -> list[float]:
    return [
        -math.log(max(float(target @ probabilities(each.columns, numbers, misled)), 1e-300))
        for each, target in zip(explained, targets, strict=True)
    ]


def _targets(explained: list[Explained], examples: list[Example]) -> list[Floats]:
    return [_target(each, example.effects) for each, example in zip(explained, examples, strict=True)]


def _target(explained: Explained, effects: frozenset[str]) -> Floats:
    """All on the right explanation; without it, on the largest explanations within it."""
    inside = [len(names) if names <= effects else -1 for names in explained.names]
    most = np.array(inside) == max(inside)
    return most / most.sum()


def _visible(example: Example) -> bool:
    """Whether the rig has no effect, or any witness shows one.

    No witness can show an effect below its detection limit; then `none` is the right answer.
    """
    names, columns = explained_by(example.ledger)
    shown = max(
        (column[0] for effects, column in zip(names, columns, strict=True) if effects <= example.effects), default=0.0
    )
    return not example.effects or shown > _SEEN or columns[:, 0].max() > _MISLEADS


def _without_its_effect(example: Example, names: list[Names], values: Floats) -> Ledger | None:
    """The ledger of a library that lacks the effect that leads; None where the library did not show it."""
    by_name = {
        name: sum(value for value, effects in zip(values.tolist(), names, strict=True) if name in effects)
        for name in example.effects
    }
    leading = max(by_name, key=lambda name: by_name[name], default="")
    if not leading or by_name[leading] <= _KNOWN:
        return None
    ledger = example.ledger
    return ledger._replace(rows=tuple(row for row in ledger.rows if leading not in row.causes))


def _no_report(_line: str, _share: float) -> None:
    """Drop the progress within a rig."""


if __name__ == "__main__":
    typer.run(train)
