"""Judge a stretch of a run: the true motion, and the controller's response to it."""

import math

import numpy as np
import numpy.typing as npt

from bench.control.answer import add_up, announce, follow_turn, follow_vibration
from bench.control.motion import follow
from bench.control.record import RING
from bridge.arrays import Floats, Records
from bridge.kernel import Record, unlocked_kernel
from plant.records import TRUTH

_FORCE, _BRISTLE, _PLACE, _DRIVE = (
    TRUTH.index(f"true_{name}") for name in ("drive_force_N", "bristle_m", "position_m", "drive_position_m")
)
_SHAKING_MPS = 1e-9  # v_a above which the base counts as vibrating


@unlocked_kernel
def watch(
    params: Records,
    state: Records,
    truth: Floats,
    v_a_mps: Floats,
    frequency_Hz: Floats,
    gain: Floats,
    traces: Records,
    events: npt.NDArray[np.float64],
    rows: npt.NDArray[np.float32],
) -> int:
    """Judge a stretch of a run; return the number of events in it, which may be more than fit.

    Args:
        params, state: one record each of `bench.control.record`; the state is advanced.
        truth: rows as `plant.records.TRUTH`, [blocks, 6, samples].
        v_a_mps, frequency_Hz: true v_a and frequency of the base at the end of each block, [blocks].
        gain: v_a for one metre of commanded amplitude at that frequency, [blocks].
        traces: traces of the controller, [blocks].
        events: filled from the first row, [most, 7]; columns as in `bench.control.record`.
        rows: filled, [blocks, 6], columns as `BLOCK_ROWS`.

    """
    p: Record = params[0]
    s: Record = state[0]
    count = 0
    for i in range(traces.shape[0]):
        t: Record = traces[i]
        shaking = v_a_mps[i] > _SHAKING_MPS
        window_s = math.ceil(p.window_s * frequency_Hz[i]) / frequency_Hz[i] if shaking else p.window_s
        force_N = 0.0
        for j in range(p.samples):
            force_N += truth[i, _FORCE, j]
            place_m, bristle_m, drive_m = truth[i, _PLACE, j], truth[i, _BRISTLE, j], truth[i, _DRIVE, j]
            count = follow(p, s, place_m, bristle_m, drive_m, window_s, v_a_mps[i], events, count)
        newest = (s.at - 1) % RING
        count = announce(p, s, t, shaking, events, count)
        add_up(p, s, t, v_a_mps[i], s.drive_m[newest] - s.x_m[newest])
        follow_turn(p, s, s.drive_m[newest] - s.x_m[newest])
        follow_vibration(p, s, t, v_a_mps[i], frequency_Hz[i], gain[i])
        rows[i, 0] = force_N / p.samples
        rows[i, 1] = s.dir * s.v_mps
        rows[i, 2] = s.dir * s.speed_mps
        rows[i, 3] = v_a_mps[i]
        rows[i, 4] = t.state
        rows[i, 5] = t.mode
    return count
