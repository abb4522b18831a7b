"""A controller as an FMU: one step is one block of samples in, and a command with its trace out."""

from collections.abc import Callable
from typing import Any

import numba
import numpy as np

from bridge.fmu.model import Model, variables_of
from bridge.kernel import record
from bridge.wire.channels import CHANNELS
from bridge.wire.messages import BLOCK, COMMAND, NO_BLOCK, TRACE, sensor_block
from controller.config import ControllerConfig
from controller.core import step
from controller.records import PARAMS, STATE, build

carray: Any = vars(numba)["carray"]
_BY_TIME = -1  # t_ns of a block that comes one block length after the last
# fields of a sensor block that the rig's guard sets; a rig without a guard leaves them as they are
OF_GUARD = (
    *("run", "guard_state", "check_Hz", "check_gain", "applied_Hz", "applied_m", "applied_block", "fallback"),
    "guard_limit",
)
_ANNOUNCED = ("announced_from_ns", "announced_mps", "announced_count")  # `controller.announced`
_OF_A_CLOCK = "lateness_ns"


def _layout(samples: int) -> np.dtype[Any]:
    """Inputs of a step that a sensor block does not have, or has in other types."""
    frame = [("sequence", "u8"), ("t_ns", "i8"), ("events", "i8"), ("gap_blocks", "i8"), ("block_ns", "i8")]
    return np.dtype([*frame, *((name, "f8", (samples,)) for name in CHANNELS)], align=True)


def compiled(_variant: str, samples: int) -> tuple[list[np.dtype[Any]], Callable[..., int]]:
    """Types of the records, and the kernel of a controller."""

    def block(params: Any, state: Any, sensors: Any, io: Any, command: Any, trace: Any) -> int:
        p, s, c, i = carray(params, 1), carray(state, 1), carray(command, 1), carray(io, 1)[0]
        b = carray(sensors, 1)
        for k in range(samples):
            b[0].drive_force_N[k], b[0].mass_accel_mps2[k] = i.drive_force_N[k], i.mass_accel_mps2[k]
            b[0].base_accel_mps2[k] = i.base_accel_mps2[k]
            b[0].mass_position_m[k], b[0].drive_position_m[k] = i.mass_position_m[k], i.drive_position_m[k]
        follows = np.uint64(s[0].block + 1 if s[0].steps > 0 else 0) + np.uint64(i.gap_blocks)
        b[0].sequence = follows if i.sequence == np.uint64(NO_BLOCK) else i.sequence
        t_ns = c[0].t_ns + (1 + i.gap_blocks) * i.block_ns if i.t_ns == _BY_TIME else i.t_ns
        b[0].t_ns = t_ns
        step(p, s, b, i.events, i.gap_blocks, t_ns, c, carray(trace, 1))
        return 0

    layout = sensor_block(samples).dtype
    return [PARAMS, STATE, layout, _layout(samples), COMMAND.dtype, TRACE.dtype], block


def model(name: str, config: ControllerConfig) -> Model:
    """The model of a controller.

    Without the inputs `sequence` and `t_ns` blocks count from 0, and their times are multiples of the block length.
    """
    params, state = build(config)
    samples = config.samples_per_block
    sensors, io = sensor_block(samples).blank(), record(_layout(samples))
    sensors["applied_block"] = io["sequence"] = NO_BLOCK
    io["t_ns"], io["events"], io["block_ns"] = _BY_TIME, BLOCK, round(config.block_s * 1e9)
    parts = [params, state, sensors, io, COMMAND.blank(), TRACE.blank()]
    about = "A controller that vibrates a base so that a slide does not stick"
    made = Model(name, about, __name__, "any", samples, config.block_s, 1, parts, [])
    places = made.places()
    inputs = {3: (*CHANNELS, "events", "gap_blocks", "sequence", "t_ns"), 2: OF_GUARD, 1: _ANNOUNCED}
    for row, fields in inputs.items():
        made.variables.extend(variables_of(parts[row], places[row], "input", {field: field for field in fields}))
    for row, prefix in ((4, "command"), (5, "trace")):
        names = {field: f"{prefix}.{field}" for field in parts[row].dtype.names or () if field != _OF_A_CLOCK}
        made.variables.extend(variables_of(parts[row], places[row], "output", names))
    return made
