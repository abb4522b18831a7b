"""Remaining margins of the amplitude loop at the delay of the run, and use of the exciter's stroke, from the log alone.

The loop works in the logarithm of v_a: the ratio of delivered to commanded vibration is an offset there, which is learned, so a
weak exciter costs stroke but no stability. The margins are for a delay one block longer than the learned delay.
"""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bridge.log.metadata import Metadata, configuration_of
from bridge.log.watches.histogram import Histogram
from bridge.wire import stickslip_pb2 as wire
from cockpit.judge.window import Window

_NEAR_LIMIT = 0.95  # share of the amplitude limit; an exciter that used more is reported as at its limit


class Margins(NamedTuple):
    """The amplitude loop in one run; shares and amplitudes are 0 in a run without vibration."""

    phase_margin_deg: float
    gain_margin: float
    loop_delay_s: float  # learned; 0 without vibration
    delivered_min: float  # 5 % quantile of delivered over commanded v_a
    delivered_max: float  # 95 % quantile
    amplitude_m: float  # largest command
    amplitude_max_m: float  # limit of the commands


class MarginSum:
    """Delivered share of the commands, and the largest command, window by window."""

    def __init__(self) -> None:
        self._share = Histogram()
        self._amplitude_m = 0.0

    def add(self, window: Window) -> None:
        """Add the judged commands of a window."""
        command = window.command[window.own(window.command)]
        self._amplitude_m = max(self._amplitude_m, float(command["amplitude_m"].max(initial=0.0)))
        _, at_trace, at_command = np.intersect1d(window.trace["block"], command["block"], return_indices=True)
        trace, command = window.trace[at_trace], command[at_command]
        commanded_mps = 2.0 * np.pi * command["frequency_Hz"] * command["amplitude_m"]
        v_a_mps = trace["vibration_velocity_mps"]
        excited = (trace["mode"] == wire.EXCITE) & (commanded_mps > 0.0) & np.isfinite(v_a_mps)
        self._share.add(v_a_mps[excited] / commanded_mps[excited])

    def result(self, headers: Metadata, path: Path, loop_delay_s: float) -> Margins:
        """Margins from the configuration in the log, shares and stroke from its commands and measurements.

        Raises Fault BAD_LOG.
        """
        # imported here: they load the design of the controller, which most verdicts do without
        from controller.config import ControllerConfig
        from controller.loop_design import margins
        from controller.records import build

        controller, plant = (configuration_of(headers, role, path) for role in ("controller", "plant"))
        params: Any = build(ControllerConfig.model_validate(controller))[0][0]
        delay_blocks = round(loop_delay_s / params.block_s)
        loop = margins(params.learn_share, params.filter_share, delay_blocks + 1, delay_blocks, params.block_s)
        return Margins(
            phase_margin_deg=loop.phase_margin_deg,
            gain_margin=loop.gain_margin,
            loop_delay_s=loop_delay_s,
            delivered_min=self._share.quantile(0.05),
            delivered_max=self._share.quantile(0.95),
            amplitude_m=self._amplitude_m,
            amplitude_max_m=min(controller["limits"]["amplitude_max_m"], plant["rig"]["piezo"]["amplitude_max_m"]),
        )


def margins_in_words(margins: Margins) -> list[str]:
    """Margins of the loop and use of the stroke, as lines for the operator."""
    m = margins
    lines = [
        f"loop     {m.loop_delay_s * 1e3:.3g} ms delay, learned; at one block more: phase margin {m.phase_margin_deg:.0f} "
        f"degrees, gain margin {m.gain_margin:.1f}"
    ]
    if m.amplitude_m > 0.0:
        enough = "AT ITS LIMIT" if m.amplitude_m > _NEAR_LIMIT * m.amplitude_max_m else "enough stroke"
        lines.append(
            f"exciter  delivers {100 * m.delivered_min:.0f} to {100 * m.delivered_max:.0f} % of its command; the loop used "
            f"{m.amplitude_m * 1e9:.0f} of {m.amplitude_max_m * 1e9:.0f} nm ({enough})"
        )
    return lines
