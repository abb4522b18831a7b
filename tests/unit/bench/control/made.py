"""Made motions of slide and drive, and the bench's judgement of them."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bench.control import record
from bench.control.watch import watch
from bridge.wire.messages import TRACE
from cockpit.run.scenario import load_rig
from plant.config import RigConfig
from plant.records import TRUTH

SAMPLE_S, SAMPLES = 5e-5, 20
Floats = npt.NDArray[np.float64]
PAPER = load_rig("paper-c45-c45", [])


class Said(NamedTuple):
    """Events by kind, [events, 6], and the memory of the judge at the end."""

    sticks: Floats
    slips: Floats
    surges: Floats
    claims: Floats
    state: Any


def times(duration_s: float) -> Floats:
    """Of the samples."""
    return (np.arange(round(duration_s / SAMPLE_S)) + 1) * SAMPLE_S


def at_speed(duration_s: float, mps: float = 5e-4) -> Floats:
    """Positions at constant velocity."""
    return times(duration_s) * mps


def along(velocity_mps: Floats) -> Floats:
    """Positions from the velocity at each sample."""
    return np.cumsum(velocity_mps) * SAMPLE_S


def judged(
    slide_m: Floats,
    drive_m: Floats,
    rig: RigConfig = PAPER,
    slowest_mps: float = 5e-4,
    v_a_mps: Floats | float = 0.0,
    gain: float = 1.0,
    **trace: Any,
) -> Said:
    """Judge a motion.

    Args:
        v_a_mps: of the base, at the end of each block.
        gain: v_a for one metre of commanded amplitude.
        trace: fields of the traces, one value a block or one for all.

    """
    blocks = len(slide_m) // SAMPLES
    truth = np.zeros((blocks, len(TRUTH), SAMPLES))
    truth[:, TRUTH.index("true_position_m")] = slide_m.reshape(blocks, SAMPLES)
    truth[:, TRUTH.index("true_drive_position_m")] = drive_m.reshape(blocks, SAMPLES)
    traces = TRACE.blank(blocks)
    for name, value in trace.items():
        traces[name] = value
    params, state = record.build(rig, slowest_mps, 0.0, 5e-3, -1)
    events = np.empty((1000, record.EVENT_COLUMNS))
    rows = np.empty((blocks, len(record.BLOCK_ROWS)), np.float32)
    base = np.broadcast_to(np.asarray(v_a_mps, float), (blocks,)).copy()
    counts = watch(params, state, truth, base, np.full(blocks, 2600.0), np.full(blocks, gain), traces, events, rows)
    kinds = [events[:counts][events[:counts, 0] == kind, 1:] for kind in range(4)]
    return Said(*kinds, state[0])
