"""Margins of the amplitude loop whose delay differs from the assumed delay.

The loop runs once a block in the logarithm of v_a, where the exciter's unknown gain is an additive constant:

    ln u[k] = ln v_set - g[k]                             commanded v_a, with the learnt gain g
    r[k]    = ln y[k] - ln e[k]                           measured over expected v_a, both behind the same low-pass
    g[k+1]  = g[k] + a (r[k] - g[k])                      a = learn share

The expected v_a is the command `assumed` blocks before, so with the true delay r is the gain itself and nothing feeds back
(a Smith predictor; Smith 1957). A wrong delay leaves the open loop

    L(z) = a / (z - 1 + a) * F(z) * (z^-delay - z^-assumed)

whose size is about the delay's error over the time constant of learning, 10 ms, for any delay. The controller learns only the
part that no delay up to 50 ms explains (`amplitude`). So these margins are lower bounds, and the loop does not oscillate even
with a larger error of the delay.

This is a design tool. The controller never imports python-control, which takes a second to load.
"""

from typing import Any, NamedTuple

import numpy as np


class LoopMargins(NamedTuple):
    """Stability margins of the loop."""

    gain_margin: float  # factor on the learn share at which the loop oscillates
    phase_margin_deg: float  # 180 if the size of the open loop stays below 1 at every frequency


def open_loop(learn_share: float, filter_share: float, delay_blocks: int, assumed_blocks: int, block_s: float) -> Any:
    """L(z), a `control.TransferFunction` sampled at the block."""
    import control

    longest = max(delay_blocks, assumed_blocks)
    late = np.zeros(longest + 1)
    late[delay_blocks] += 1.0
    late[assumed_blocks] -= 1.0
    learning: Any = control.tf([learn_share], [1.0, learn_share - 1.0], block_s)
    low_pass: Any = control.tf([filter_share, 0.0], [1.0, filter_share - 1.0], block_s)
    return learning * low_pass * control.tf(late, [1.0, *([0.0] * longest)], block_s)


def margins(
    learn_share: float, filter_share: float, delay_blocks: int, assumed_blocks: int, block_s: float = 1e-3
) -> LoopMargins:
    """The margins for a true and an assumed delay. Raises ValueError for negative delays."""
    import control

    if min(delay_blocks, assumed_blocks) < 0:
        raise ValueError(f"delay_blocks = {delay_blocks}, assumed_blocks = {assumed_blocks}: must not be below 0")
    if delay_blocks == assumed_blocks:
        return LoopMargins(np.inf, 180.0)
    loop = open_loop(learn_share, filter_share, delay_blocks, assumed_blocks, block_s)
    # from the frequency response: the polynomial method loses digits from six blocks of delay on
    gain_margin, phase_deg, *_ = control.stability_margins(loop, method="frd")
    return LoopMargins(float(gain_margin), float(phase_deg) if np.isfinite(phase_deg) else 180.0)
