"""A simulated rig as an FMU: the plant's kernel, without guard, noise and digitising."""

import math
from collections.abc import Callable
from typing import Any

import numba
import numpy as np

from bridge.fmu.model import Model, Variable, variables_of
from bridge.kernel import record
from bridge.units import unit_of
from bridge.wire.channels import CHANNELS
from plant.config import RigConfig
from plant.core import advance, advance_disturbed
from plant.records import PARAMS, STATE, TRUTH, build
from plant.simulate import held_velocity

carray: Any = vars(numba)["carray"]
_SLIDE = TRUTH.index("true_velocity_mps")
_MOST_BLOCKS = 1_000_000  # a step of the master, 17 min: longer ones are slips of a unit
# parameters by the field that the kernel reads; other parameters are set at the export, as `plant.records.build` derives further
# numbers from them
_PARAMETERS = {
    "h_d": "drive.damping_Ns_per_m",
    "h_v": "contact.viscous_damping_Ns_per_m",
    "v_s": "contact.stribeck_velocity_mps",
}


def _layout(samples: int) -> np.dtype[Any]:
    """Inputs and outputs; F_c_N and F_s_N are the friction forces at a load of 1."""
    inputs = [(name, "f8") for name in ("drive", "frequency_Hz", "amplitude_m", "load", "F_c_N", "F_s_N")]
    return np.dtype(
        [*inputs, ("analogue", "f8", (len(CHANNELS), samples)), ("truth", "f8", (len(TRUTH), samples))], align=True
    )


def _rows(io: Any, at: int, field: str, names: tuple[str, ...]) -> list[Variable]:
    """The rows of a field of the record `io`, which is at `at` in the memory, as outputs."""
    [whole] = variables_of(io, at, "output", {field: field})
    count = whole.length // len(names)
    rows = enumerate(names)
    return [
        whole._replace(name=name, at=whole.at + 8 * count * row, length=count, unit=unit_of(name)) for row, name in rows
    ]


def compiled(variant: str, samples: int) -> tuple[list[np.dtype[Any]], Callable[..., int]]:
    """Types of the records, and the kernel of a `nominal` or a `disturbed` rig."""
    step: Any = {"nominal": advance, "disturbed": advance_disturbed}[variant]

    def block(params: Any, state: Any, io: Any) -> int:
        p, s, i = carray(params, 1), carray(state, 1), carray(io, 1)[0]
        p[0].F_c, p[0].F_s = i.load * i.F_c_N, i.load * i.F_s_N
        step(p, s, i.drive, i.frequency_Hz, i.amplitude_m, i.analogue, i.truth)
        return 0 if math.isfinite(i.truth[_SLIDE, -1]) else 1

    return [PARAMS, STATE, _layout(samples)], block


def model(rig: RigConfig) -> Model:
    """The model of a rig."""
    params, state = build(rig)
    p, samples = params[0], rig.solver.samples_per_block
    io = record(_layout(samples))
    io["drive"] = 0.0 if p.force_driven else held_velocity(rig)(np.zeros(1))[0]
    io["frequency_Hz"], io["load"], io["F_c_N"], io["F_s_N"] = p.frequency_max_Hz, 1.0, p.F_c, p.F_s
    about = "A slide that is pulled through a compliant drive, on a base that an exciter vibrates"
    variant = "disturbed" if p.disturbed else "nominal"
    parts = [params, state, io]
    made = Model(rig.name, about, __name__, variant, samples, rig.solver.block_s, _MOST_BLOCKS, parts, [])
    at_params, _, at_io = made.places()
    inputs = {"drive": "pull_N" if p.force_driven else "drive_velocity_mps"}
    inputs |= {name: name for name in ("frequency_Hz", "amplitude_m", "load")}
    made.variables.extend(variables_of(io, at_io, "input", inputs))
    made.variables.extend([*_rows(io, at_io, "analogue", CHANNELS), *_rows(io, at_io, "truth", TRUTH)])
    made.variables.extend(variables_of(params, at_params, "parameter", _PARAMETERS))
    return made
