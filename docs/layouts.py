"""The stub bridge/layouts.pyi, made by `make layouts` from the dtypes of the records that kernels read and write."""

from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np

from bridge.guard import records as guard
from bridge.rig.step import DEVICE
from bridge.wire.messages import ANNOUNCE, APPLIED, COMMAND, TRACE, sensor_block
from controller import records as controller
from plant import records as plant

STUB = Path(__file__).parents[1] / "bridge" / "layouts.pyi"
_HEAD = """\
# Made by `make layouts`; change the dtype instead.
from typing import Any

import numpy.typing as npt
"""
_RECORDS: dict[str, np.dtype[Any]] = {
    "ControllerParams": controller.PARAMS,
    "ControllerMemory": controller.STATE,
    "GuardParams": guard.PARAMS,
    "GuardMemory": guard.STATE,
    "DeviceMemory": DEVICE,
    "PlantParams": plant.PARAMS,
    "PlantMemory": plant.STATE,
    "SensorRow": sensor_block(1).dtype,
    "AppliedRow": APPLIED.dtype,
    "CommandRow": COMMAND.dtype,
    "TraceRow": TRACE.dtype,
    "AnnounceRow": ANNOUNCE.dtype,
}


def stub() -> str:
    """The text of the stub."""
    return _HEAD + "".join(f"\nclass {name}:\n{_fields(dtype)}\n" for name, dtype in _RECORDS.items())


def _fields(dtype: np.dtype[Any]) -> str:
    fields = "; ".join(f"{name}:{_type(dtype[name])}" for name in sorted(dtype.names or ()))
    return fill(fields, 120, initial_indent="    ", subsequent_indent="    ")


def _type(field: np.dtype[Any]) -> str:
    if field.shape:
        return "npt.NDArray[Any]"
    return "float" if field.kind == "f" else "int"


if __name__ == "__main__":
    STUB.write_text(stub(), encoding="utf-8")
