"""Design of the amplitude loop: the gain for a phase margin, and how the loop then behaves.

The loop runs once a block in the logarithm of the velocity amplitude. The unknown gain of the exciter (a
resonating mount, a weak amplifier) is then an additive constant, and the margins do not depend on it:

    c[k + 1] = c[k] + K (ln v_set[k] - y[k])                 commanded u0 = v_set exp(c) / (2 pi f)
    y[k]     = a y[k - 1] + (1 - a) ln v[k - d]              a = exp(-block / tau)

y is the demodulated velocity behind its low-pass, exact for an amplitude held over a block. d counts the
blocks until a delivered amplitude is measured, beyond the block that the integrator holds. Where every command
acts on the next block, as in lockstep, d is 0 and the phase margin 69 degrees instead of 60. The default of 2 is
a reserve for late commands.

This is a design tool. The controller runs on its result and never imports python-control, which takes a second to load.
"""

from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq


class LoopDesign(NamedTuple):
    """A gain and the behaviour of the loop with it."""

    gain: float  # K, per block
    gain_margin: float  # factor on K at which the loop oscillates
    phase_margin_deg: float
    crossover_Hz: float
    settling_s: float  # time after which a step of ln v_set leaves the delivered ln v within 2 % of the step


def open_loop(gain: float, block_s: float, measurement_tau_s: float, delay_blocks: int) -> Any:
    """K / (z - 1) times (1 - a) z / (z - a) times z^-d, a `control.TransferFunction` sampled at the block."""
    import control  # noqa: PLC0415 - takes a second to load, and only the design needs it

    a = float(np.exp(-block_s / measurement_tau_s))
    denominator = np.polymul([1.0, -1.0], [1.0, -a])
    return control.tf([gain * (1.0 - a), 0.0], [*denominator, *([0.0] * delay_blocks)], block_s)


def design(
    block_s: float = 1e-3,
    measurement_tau_s: float = 5e-3,
    delay_blocks: int = 2,
    phase_margin_deg: float = 60.0,
) -> LoopDesign:
    """Choose K for the phase margin [degrees, 20 to 80] and report margins, crossover and settling.

    Raises ValueError outside that range or for a delay outside 1 to 10 blocks: without delay there is no gain
    margin to search up to, and beyond 10 the margins are untested.
    """
    import control  # noqa: PLC0415

    if not 20.0 <= phase_margin_deg <= 80.0:
        raise ValueError(f"phase_margin_deg = {phase_margin_deg}: must lie in 20..80; 60 is usual")
    if not 1 <= delay_blocks <= 10:
        raise ValueError(f"delay_blocks = {delay_blocks}: must lie in 1..10; use longer blocks for a slower bus")

    def margins(gain: float) -> tuple[float, float, float]:
        loop = open_loop(gain, block_s, measurement_tau_s, delay_blocks)
        # from the frequency response: the polynomial method loses digits from six blocks of delay on
        margin, phase_deg, _, _, crossover_rad_per_s, _ = control.stability_margins(loop, method="frd")
        return float(margin), float(phase_deg), float(crossover_rad_per_s)

    def excess_deg(gain: float) -> float:
        return margins(gain)[1] - phase_margin_deg

    # The phase margin falls from 90 degrees at K = 0 to 0 at the ultimate gain. Of several phase crossings the library reports
    # the one nearest to the given gain, so the margin is asked at 1e-3, far below; at 1 it is a later crossing from four blocks
    # of delay on.
    ultimate_gain = 1e-3 * margins(1e-3)[0]
    root: Any = brentq(excess_deg, 1e-3 * ultimate_gain, 0.999 * ultimate_gain)
    gain = float(root)
    gain_margin, margin_deg, crossover_rad_per_s = margins(gain)
    return LoopDesign(
        gain=gain,
        gain_margin=gain_margin,
        phase_margin_deg=margin_deg,
        crossover_Hz=crossover_rad_per_s / (2.0 * np.pi),
        settling_s=_settling_s(gain, block_s, measurement_tau_s, delay_blocks),
    )


def _settling_s(gain: float, block_s: float, measurement_tau_s: float, delay_blocks: int) -> float:
    """Settling time of the correction c after a step of the exciter's gain, which moves the delivered ln v by the same step."""
    import control  # noqa: PLC0415

    loop = open_loop(gain, block_s, measurement_tau_s, delay_blocks)
    # ln v = ln v_set + c + ln(gain of the exciter): a step of set point or gain is a disturbance at the output
    sensitivity = control.feedback(control.tf([1.0], [1.0], block_s), loop)
    # ten times the slowest time constant of the loop; the integrator alone needs 1 / K blocks
    t_s = block_s * np.arange(int(10.0 * (1.0 / gain + measurement_tau_s / block_s + delay_blocks)))
    _, left = control.step_response(sensitivity, t_s)
    outside = np.flatnonzero(np.abs(np.asarray(left)) > 0.02)
    return float(t_s[outside[-1]] + block_s)
