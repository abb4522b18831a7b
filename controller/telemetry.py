"""Messages besides commands and traces: the state for plots, and the controller's whole memory for replay."""

import numpy as np

from bridge.arrays import Records
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import STATE
from controller.records import LAYOUT_ID

STATE_EVERY = 10  # steps between state messages: 100 Hz with blocks of 1 ms
SNAPSHOT_EVERY = 1000  # steps between snapshots: one a second with blocks of 1 ms

_COPIED = (
    *("t_ns", "drive_force_N", "vibration_velocity_mps", "drive_velocity_mps", "force_rate"),
    *("mode", "state", "slips"),
)


def plotted(traces: Records, steps: int) -> Records:
    """The state messages of `traces`, which are STATE_EVERY apart, [n]; `steps`: number of steps up to the first of them."""
    states = STATE.blank(len(traces))
    states["sequence"] = steps // STATE_EVERY - 1 + np.arange(len(traces))
    for name in _COPIED:
        states[name] = traces[name]
    drive_mps = np.abs(traces["drive_velocity_mps"])
    # under these limits the trace repeats an old v_a
    is_new = (traces["limit"] != wire.STALE_INPUT) & (traces["limit"] != wire.NOT_FINITE)
    shown = (traces["state"] > wire.STANDSTILL) & (drive_mps > 0.0) & is_new
    np.divide(traces["vibration_velocity_mps"], drive_mps, out=states["velocity_ratio"], where=shown)
    return states


def snapshot(memory: Records, steps: int, t_ns: int) -> bytes:
    """The message with the controller's memory after `steps` steps; `t_ns` is the time of the last frame."""
    message = wire.Snapshot(
        sequence=steps // SNAPSHOT_EVERY - 1, t_ns=t_ns, step=steps - 1, layout=LAYOUT_ID, memory=memory.tobytes()
    )
    return message.SerializeToString()
