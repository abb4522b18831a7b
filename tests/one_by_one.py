"""A run of the twin through the plant's own kernel, block by block, one rig after the other: what `side_by_side` must do too."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from diagnosis.commands import Commands
from diagnosis.reduced import SIGNALS
from diagnosis.twin import Start, built
from plant.config import RigConfig
from plant.core import advance, advance_disturbed
from plant.records import CHANNELS, TRUTH

Floats = npt.NDArray[np.floating[Any]]


def one_by_one(configs: Sequence[RigConfig], commands: Commands, start: Start) -> list[dict[str, Floats]]:
    """As `twin.predict_many`, without entries."""
    return [dict(zip(SIGNALS, _one(config, commands, start), strict=True)) for config in configs]


def _one(config: RigConfig, commands: Commands, start: Start) -> Floats:
    params, state, steps = built(config, False, commands, start)
    p = params[0]
    most = int(steps.max())
    analogue, truth = np.empty((len(CHANNELS), most)), np.empty((len(TRUTH), most))
    out = np.empty((len(SIGNALS), len(steps)))
    advanced = advance_disturbed if p.disturbed else advance
    p.steps_per_sample = 1
    per_block = zip(steps.tolist(), commands.drive, commands.frequency_Hz, commands.amplitude_m, strict=True)
    for block, (samples, drive, frequency_Hz, amplitude_m) in enumerate(per_block):
        p.samples_per_block, p.dt_s = samples, 1e-3 / samples
        advanced(params, state, drive, frequency_Hz, amplitude_m, analogue[:, :samples], truth[:, :samples])
        out[:5, block] = analogue[:, :samples].mean(axis=1)
        out[5:, block] = [math.sqrt(analogue[row, :samples].var()) for row in (1, 2)]
    return out
