"""A simulated device in another process, and the rig file for it."""

import json
import re
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from bridge.config import validate
from bridge.rig.file import DeviceRig
from bridge.wire.channels import CHANNELS
from tests.patience import PATIENCE_S

GUARD = {"fastest_drive_mps": 1e-3, "velocity_mps": {"alarm": 3e-3, "abort": 4e-3}}


def table(**more: Any) -> dict[str, Any]:
    """The table of a rig file for five channels in SI units."""
    channels = {name: {"source": row} for row, name in enumerate(CHANNELS)}
    base = {"name": "box", "adapter": "stream", "channels": channels, "guard": GUARD, "exciter": {"enable_line": True}}
    return base | more


def rig_file(**more: Any) -> DeviceRig:
    return validate(DeviceRig, table(**more), "mine.toml")


def toml(values: dict[str, Any]) -> str:
    """A table of plain values as TOML."""

    def text(value: Any) -> str:
        if isinstance(value, dict):
            return "{ " + ", ".join(f"{json.dumps(key)} = {text(inner)}" for key, inner in value.items()) + " }"
        return json.dumps(value)

    return "".join(f"{json.dumps(key)} = {text(value)}\n" for key, value in values.items())


@contextmanager
def boxed(folder: Path, **config: Any) -> Generator[int]:
    """Run `stickslip rig box`; yields its port."""
    path = folder / "box.toml"
    path.write_text(toml({"rig": "paper-c45-c45", "waits": True} | config))
    process = subprocess.Popen(
        [sys.executable, "-m", "cockpit", "rig", "box", str(path)],
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
    )
    assert process.stderr is not None
    try:
        for line in process.stderr:
            if found := re.search(r"^box .* at [\d.]+:(\d+)$", line.strip()):
                yield int(found[1])
                break
        else:
            raise AssertionError("the box ended")
    finally:
        process.terminate()
        process.wait(PATIENCE_S)
        process.stderr.close()
