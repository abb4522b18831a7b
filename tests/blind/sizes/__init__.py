"""Kept sizes: with these a set is made again without sizing, and is the same set for every version of the sizing.

`<generator>-<seed>.toml` next to this file has a table for the seed of each case; an entry gives the strength of an effect and
the detection limits that the effect is worth. These files hold all of the answers but the names of the cases, so a set made
with them is development data.
"""

import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

Sizes = Mapping[str, tuple[float, float]]  # of one case, by effect
OPENED = {
    ("plant", 5980595),
    ("plant", 6073459),
}  # generator and seed of sets with a published score and without kept sizes


def known_sizes(generator: str, seed: int) -> dict[int, Sizes]:
    """The kept sizes, by the seed of a case; empty where a set was never sized."""
    path = Path(__file__).parent / f"{generator}-{seed}.toml"
    return read_sizes(path) if path.is_file() else {}


def read_sizes(path: Path) -> dict[int, Sizes]:
    """The sizes in a file of `write_sizes`, by the seed of a case."""
    table: dict[str, dict[str, list[float]]] = tomllib.loads(path.read_text(encoding="utf-8"))
    return {
        int(seed): {name: (strength, limits) for name, (strength, limits) in effects.items()}
        for seed, effects in table.items()
    }


def write_sizes(path: Path, answers: Iterable[Mapping[str, Any]]) -> None:
    """Write the sizes of all effects that have a size."""
    lines = [
        "# seed of a case, and of each of its effects the strength and the detection limits that it is worth there"
    ]
    for answer in sorted(answers, key=lambda one: one["counterfactual_seed"]):
        sized = [effect for effect in answer["effects"] if effect["detectability"] is not None]
        if sized:
            lines += ["", f"[{answer['counterfactual_seed']}]"]
            lines += [f"{size['name']} = [{size['strength']}, {size['detectability']}]" for size in sized]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
