"""Frames for a browser: a length, JSON, then columns of float32, all little-endian."""

import json
import struct
from typing import Any

import numpy as np
import numpy.typing as npt

from bridge.results import strict_json

_ALIGNED = 4  # a browser reads float32 only at offsets divisible by 4


def frame(kind: str, table: dict[str, Any], columns: npt.NDArray[np.float32] | None = None) -> bytes:
    """Bytes of one frame.

    Args:
        kind: kind of frame, for the page.
        table: values that JSON can represent.
        columns: [columns, values]; the JSON contains both counts.

    """
    rows, count = columns.shape if columns is not None else (0, 0)
    header = {"kind": kind, **table, "rows": rows, "count": count}
    text = json.dumps(strict_json(header), allow_nan=False, separators=(",", ":")).encode()
    text += b" " * (-len(text) % _ALIGNED)
    data = np.ascontiguousarray(columns, "<f4").tobytes() if columns is not None else b""
    return struct.pack("<I", len(text)) + text + data
