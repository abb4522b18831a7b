"""Whether a rig is one that this controller can control, by what the rig says of itself before the first block."""

import contextlib
import json
from typing import Any

from bridge.faults import Fault
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.payloads import refuse_other_schema
from controller.config import ControllerConfig


def refuse_another_rig(header: wire.Header | None, config: ControllerConfig) -> None:
    """Raise Fault where a rig's blocks cannot be those that the controller was configured for.

    BAD_MESSAGE: another schema version; CONFIG: blocks of another length or number of samples. A rig that says nothing of itself
    is taken at its blocks.
    """
    if header is None:
        return
    refuse_other_schema(header)
    solver: Any = None
    with contextlib.suppress(ValueError, TypeError, KeyError, RecursionError):
        solver = json.loads(header.configuration)["rig"]["solver"]
    if not isinstance(solver, dict):
        return
    for name in ("block_s", "samples_per_block"):
        theirs, ours = solver.get(name), getattr(config, name)
        if isinstance(theirs, int | float) and abs(theirs - ours) > 0.01 * ours:
            line = f"header/plant: rig.solver.{name} = {theirs:g}: must be controller.{name} = {ours:g}"
            raise Fault("CONFIG", f"{line}; set both to the same number")
