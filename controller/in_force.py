"""The time for which the rig has vibrated as commanded: only then does the slide's motion show whether the vibration is enough.

Without a fresh command the rig ramps to zero, the guard may hold a command back, after a stall the blocks are late, and the
exciter's gain may leap, while the controller continues to command. Time, positions, force and slips of such blocks are valid,
and v_a is compared with the applied vibration. But no ratio changes and no trial starts until the slide has settled.
"""

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory, ControllerParams, SensorRow
from bridge.wire.messages import BLOCK, LATE, STALE
from bridge.wire.stickslip_pb2 import NO_CAUSE, SLEW_RATE

# Time in force until the slide's motion counts again. Shorter: a slide that an interruption released raises the ratio.
SETTLED_S = 0.15
# Settling times of the spring after which the ratio changes again. The slide stops in an interruption and then runs ahead until
# the spring has settled, which looks like a swing of friction. Shorter: with 0, an exciter that delivers double for 80 ms of each
# second raised the ratio from 1.2 to 1.43; gaps in the commands did so on none of five axes. Longer: a swing is followed later.
_SPRING = 2.0


@kernel
def note_in_force(p: ControllerParams, s: ControllerMemory, events: int, block: SensorRow) -> None:
    """Track how long the commands have been in force; `block` is not read when `events` has no BLOCK."""
    held_back = events & (STALE | LATE) != 0 or s.unexplained != 0
    if events & BLOCK and (s.allowed_m > 0.0 or block.applied_m > 0.0):
        held_back = held_back or block.fallback == 1 or block.guard_limit not in (NO_CAUSE, SLEW_RATE)
    s.in_force_s = 0.0 if held_back else s.in_force_s + p.block_s


@kernel
def is_settled(s: ControllerMemory, spring_s: float) -> bool:
    """Whether the slide has settled after the last interruption, for a settling time of its spring [s]: else no ratio rises."""
    return s.in_force_s > max(SETTLED_S, _SPRING * spring_s)
