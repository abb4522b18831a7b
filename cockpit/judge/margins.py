"""What is left of the amplitude loop's margins on a rig that differs from the one it was designed for, from the log alone.

The loop works in the logarithm of v_a: what the exciter delivers of its command is an offset there, which the integrator makes
up for, so a weak exciter costs stroke and no stability. Both are said: the margins, and how much of the stroke was needed.
"""

from typing import Any, NamedTuple

import numpy as np

from bridge.log.logfile import RunData
from bridge.wire import stickslip_pb2 as wire
from controller.loop_design import open_loop

_DELAY_BLOCKS = 2  # in reserve, as in controller/loop_design.py
_NEAR_LIMIT = 0.95


class Margins(NamedTuple):
    """The amplitude loop in one run; shares and amplitudes are 0 in a run without vibration."""

    phase_margin_deg: float
    gain_margin: float
    delivered_min: float  # share of the commanded v_a, 5 % of the time below
    delivered_max: float
    amplitude_m: float  # the largest commanded
    amplitude_max_m: float  # what limits it

    def as_dict(self) -> dict[str, Any]:
        """For `--json`."""
        return self._asdict()


def loop_margins(run: RunData) -> Margins:
    """Margins from the configuration in the log, shares and stroke from its commands and measurements."""
    import control

    controller, plant = run.configuration("controller"), run.configuration("plant")
    loop = controller["amplitude"]
    gain_margin, phase_deg, *_ = control.stability_margins(
        open_loop(loop["gain"], controller["block_s"], loop["filter_s"], _DELAY_BLOCKS), method="frd"
    )
    _, at_trace, at_command = np.intersect1d(run.trace["block"], run.command["block"], return_indices=True)
    trace, command = run.trace[at_trace], run.command[at_command]
    excited = (trace["mode"] == wire.EXCITE) & (command["amplitude_m"] > 0.0)
    told_mps = 2.0 * np.pi * command["frequency_Hz"][excited] * command["amplitude_m"][excited]
    share = trace["vibration_velocity_mps"][excited] / told_mps
    low, high = np.quantile(share, (0.05, 0.95)) if len(share) else (0.0, 0.0)
    return Margins(
        phase_margin_deg=float(phase_deg),
        gain_margin=float(gain_margin),
        delivered_min=float(low),
        delivered_max=float(high),
        amplitude_m=float(command["amplitude_m"].max()) if len(command) else 0.0,
        amplitude_max_m=min(controller["limits"]["amplitude_max_m"], plant["rig"]["piezo"]["amplitude_max_m"]),
    )


def margins_in_words(margins: Margins) -> list[str]:
    """As lines for a person."""
    m = margins
    lines = [
        f"loop     phase margin {m.phase_margin_deg:.0f} degrees, gain margin {m.gain_margin:.1f}, whatever the exciter delivers"
    ]
    if m.amplitude_m > 0.0:
        enough = "AT ITS LIMIT" if m.amplitude_m > _NEAR_LIMIT * m.amplitude_max_m else "enough stroke"
        lines.append(
            f"exciter  delivers {100 * m.delivered_min:.0f} to {100 * m.delivered_max:.0f} % of its command; the loop used "
            f"{m.amplitude_m * 1e9:.0f} of {m.amplitude_max_m * 1e9:.0f} nm ({enough})"
        )
    return lines
