"""The true force on a force-driven axis, from the measured force, the force sensor's effects and the chain's delays.

This is the inverse of `sensor_chain.sensed`.
"""

import numpy as np
from scipy.ndimage import gaussian_filter1d

from bridge.arrays import Floats
from diagnosis.features.grid import BLOCK_S
from diagnosis.features.segments import CommandedRun
from diagnosis.model.rig import Effects
from diagnosis.model.sensor_chain import SensorChain, delayed, true_force_N

# Standard deviation of the smoothing of the rate that inverts a low-pass. Too small: noise; too large: smeared reversals.
_DERIVATIVE_S = 2e-3


def relative(chain: SensorChain) -> SensorChain:
    """The chain with all delays relative to the position sensor: along a measured motion only their difference shows."""
    return chain._replace(force_delay_s=chain.force_delay_s - chain.position_delay_s, position_delay_s=0.0)


def true_commands(commands: CommandedRun, effects: Effects, chain: SensorChain) -> CommandedRun:
    """The commands of a force-driven run with the true force [N] and the true motion; `chain` is from `relative`."""
    motion = commands.motion
    assert motion is not None, "a force drive has a motion"  # noqa: S101
    motion = motion._replace(position_m=motion.position_m / chain.position_scale)
    return commands._replace(drive=_true_force(commands.drive, effects, chain), motion=motion)


def _true_force(force_N: Floats, effects: Effects, chain: SensorChain) -> Floats:
    force_N = true_force_N(force_N, effects, (np.arange(len(force_N)) + 0.5) * BLOCK_S)
    delay_s = chain.force_delay_s
    if "force-sensor-delay" in effects:
        delay_s += float(effects["force-sensor-delay"]["delay_s"])
    force_N = delayed(force_N, -delay_s)
    if "force-sensor-lag" in effects:
        table = effects["force-sensor-lag"]
        for _ in range(1 if table["form"] == "first-order" else 2):
            rate = gaussian_filter1d(force_N, _DERIVATIVE_S / BLOCK_S, order=1) / BLOCK_S
            force_N = force_N + float(table["lag_s"]) * rate
    return force_N
