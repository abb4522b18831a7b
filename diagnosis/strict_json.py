"""JSON as the standard has it, written whole or not at all."""

import json
import math
from pathlib import Path
from typing import Any

from diagnosis.report import write_whole


def strict_json(value: Any) -> Any:
    """`value` with null for NaN and infinity, which JSON does not know."""
    if isinstance(value, dict):
        return {key: strict_json(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [strict_json(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def write_json(path: Path, value: Any) -> None:
    """Write a file, its folder too. Raises OSError."""
    write_whole(path, json.dumps(strict_json(value), allow_nan=False, indent=1) + "\n")
