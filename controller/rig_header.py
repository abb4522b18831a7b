"""The rig's header, read before the first block: whether this controller fits the rig, and the limits of the rig."""

import contextlib
import json
from typing import Any

from pydantic import TypeAdapter, ValidationError

from bridge.faults import Fault
from bridge.guard.config import VibrationLimits
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.channels import CHANNELS
from bridge.wire.payloads import refuse_other_schema
from controller.config import ControllerConfig, seeing, within
from controller.freshness import COMPUTERS

# Largest drift of a converter's clock. Smaller: 500 ppm are reported as LATE after a minute. Larger: a delay that lasts for less
# than 1.5 s is not reported.
_CONVERTERS = 1e-2
_LIMITS = TypeAdapter(VibrationLimits)


def for_rig(header: wire.Header | None, config: ControllerConfig) -> ControllerConfig:
    """The configuration with the limits of the rig's header, and without the channels that the rig lacks.

    Raises Fault BAD_MESSAGE for another schema version, CONFIG for blocks of another length or number of samples, for unreadable
    limits, for a given limit that is looser, and if its channels show no stick. The blocks of a rig without a header are checked
    as they arrive.
    """
    if header is None:
        return config
    refuse_other_schema(header)
    table: Any = None
    with contextlib.suppress(ValueError, RecursionError):
        table = json.loads(header.configuration)
    solver = _part(_part(table, "rig"), "solver")
    for name in ("block_s", "samples_per_block"):
        theirs, ours = _part(solver, name), getattr(config, name)
        if isinstance(theirs, int | float) and abs(theirs - ours) > 0.01 * ours:
            line = f"header/plant: rig.solver.{name} = {theirs:g}: must be controller.{name} = {ours:g}"
            raise Fault("CONFIG", f"{line}; set both to the same number")
    limits, channels = _part(table, "limits"), _part(_part(table, "rig"), "channels")
    absent = [name for name in CHANNELS if _part(_part(channels, name), "absent") is True]
    try:
        config = seeing(config, absent)
        return config if limits is None else within(config, _LIMITS.validate_python(limits))
    except ValidationError as error:
        problem = error.errors()[0]
        place = ".".join(map(str, problem["loc"]))
        line = f"header/plant: limits.{place} = {problem['input']!r}: {problem['msg']}"
        raise Fault("CONFIG", f"{line}; see bridge/wire/PROTOCOL.md for its fields") from None
    except ValueError as error:
        raise Fault("CONFIG", f"controller.{error}") from None


def clock_drift(header: wire.Header | None) -> float:
    """Largest relative drift of the rig's clock against a computer's: a converter paces the blocks of a real rig."""
    table: Any = None
    if header is not None:
        with contextlib.suppress(ValueError, RecursionError):
            table = json.loads(header.configuration)
    return COMPUTERS if _part(_part(table, "rig"), "converter") is None else _CONVERTERS


def _part(table: Any, name: str) -> Any:
    return table.get(name) if isinstance(table, dict) else None


def refuse_another_rig(header: wire.Header | None, config: ControllerConfig) -> None:
    """Raise Fault if the header of a restarted rig does not match the configuration; CONFIG also for other limits."""
    if for_rig(header, config) != config:
        line = "header/plant: limits: differ from those before the rig was restarted: must stay the same"
        raise Fault("CONFIG", f"{line}; start this controller again")
