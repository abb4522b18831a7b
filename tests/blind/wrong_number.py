"""Rigs without a gap, and one wrong number in their description."""

import math
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from diagnosis.hypotheses.hypothesis import LEVELS

EFFECT_OF = {key: effect for effect, key in LEVELS.items()}  # the name of a wrong number among the candidates
# Distance of the described number from the true one, in its tolerances. Less: a rig within its tolerances may be as far off.
_FEWEST, _MOST = 5.0, 20.0
_LEAST, _LARGEST = math.log(1.08), math.log(2.0)  # logarithm of the factor; the largest yields to five tolerances
_STATIC = 1.06  # least static friction of a description, in Coulomb frictions: its owner knows that the rig sticks


def describe_wrong(folder: Path, true: Mapping[str, float], random: np.random.Generator) -> dict[str, Any]:
    """Describe one number that the diagnosis may name wrong, up or down; return its name, described and true value.

    Args:
        folder: the evidence.
        true: the numbers of the rig, by key of the manifest.
        random: draws number, direction and distance.

    """
    rig = tomllib.loads((folder / "manifest.toml").read_text(encoding="utf-8"))["rig"]
    name = str(random.choice([key for key in EFFECT_OF if rig["tolerance"].get(key, 0.0) > 0.0]))
    tolerance = rig["tolerance"][name]
    least = max(_FEWEST * tolerance, _LEAST)
    factor = math.exp(random.uniform(least, max(least, min(_MOST * tolerance, _LARGEST))))
    both = (float(f"{true[name] * factor:.4g}"), float(f"{true[name] / factor:.4g}"))
    described = float(random.choice([value for value in both if _sticks(rig | {name: value})]))
    write_number(folder, name, described)
    return {"name": name, "described": described, "true": true[name]}


def _sticks(rig: Mapping[str, float]) -> bool:
    return rig["static_force_N"] >= _STATIC * rig["coulomb_force_N"]


def write_number(folder: Path, name: str, value: float) -> None:
    """Change a number in the table `[rig]` of a manifest."""
    path = folder / "manifest.toml"
    text, changed = re.subn(rf"(?m)^{name} = .*$", f"{name} = {value!r}", path.read_text(encoding="utf-8"), count=1)
    if not changed:
        raise ValueError(f"{path}: has no {name}")
    path.write_text(text, encoding="utf-8")
