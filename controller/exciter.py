"""The exciter: its gain, learnt from the delivered v_a, and the stroke for a wanted v_a.

The measured v_a is compared with all vibrations that the rig applied within the longest delay of the loop. The gain is learnt
only from a v_a that none of them explains (set membership: the delay is unknown but bounded). So it does not overshoot, for any
delay, gap or limit of the guard, and the loop needs no integrator.

The known gain comes from the rig's loop check, else from the configuration, else from the first even vibration. The stroke is at
most the stroke for the known gain, times the band, as an accelerometer that loses gain looks like an exciter that loses gain. The
contact is the second witness: a slide that sticks shows a warm exciter, which is followed down to a floor. A gain that leaps down
by more than the band is a loose plug.
"""

import math
from typing import Any

import numpy as np

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory, ControllerParams, SensorRow
from bridge.wire.messages import RESET
from bridge.wire.stickslip_pb2 import CHECKING, OPEN_LOOP
from controller.in_force import is_settled
from controller.trips.doubts import ACCELEROMETER, trip

FIRST_SHARE = 0.1  # first stroke over the stroke of the rigid mount, for a gain that was never measured
LEARN_S = 0.01  # time constant of the learnt gain
MOST_DELAY_S = 0.05  # longest delay of the gain's learning. Larger: a gain that changes with v_d is learnt later
TAIL = 3.0  # time constants of the demodulator's low-pass after which an earlier vibration has no effect
SLOTS = 6  # time slots of the extremes of the applied vibration. Fewer: they reach back further, and the gain is learnt later
_STEADY = 0.05  # largest difference of v_a from its low-pass, over v_a, from which a first gain is known
_HEARD = 5.0  # smallest v_a that counts as detected, over the v_a that noise shows at rest
HOLD_S = 0.1  # time of a gain outside of its bounds until it is reported; a slip that shakes the base is shorter
# Time constant of the gain with which a leap is compared. Shorter: leaps are missed. Longer: an exciter that warms up leaps.
FOLLOW_S = 0.5
_CHECK_BLOCKS = 16  # blocks after a loop check that carry its result, a tone each; 8 tones at most, so each comes twice
_SAME_HZ = 1.0  # largest difference of the applied frequency, a short float, from the command


@kernel
def begin_gain(p: ControllerParams, s: ControllerMemory) -> None:
    """Start from the configured gain alone; without one, no gain is known."""
    s.known_gain, s.accepted_share = p.configured_gain, 1.0
    s.gain = s.followed_gain = p.configured_gain if p.configured_gain > 0.0 else 1.0 / FIRST_SHARE
    s.checked_blocks = 0


@kernel
def note_check(p: ControllerParams, s: ControllerMemory, block: SensorRow) -> None:
    """Read the gains of the rig's loop check, a tone a block.

    Between two tones a mount may resonate, so the gain counts as known only if the tones are alike.
    """
    gain, rolled_off = float(block.check_gain), float(block.check_Hz) / p.accel_bandwidth_Hz
    if gain <= 0.0 or s.checked_blocks >= _CHECK_BLOCKS or s.guard_state == CHECKING:
        return
    gain *= math.sqrt(1.0 + rolled_off * rolled_off)
    first = s.checked_blocks == 0
    s.check_least = gain if first else min(s.check_least, gain)
    s.check_most = gain if first else max(s.check_most, gain)
    s.checked_blocks += 1
    if s.checked_blocks == _CHECK_BLOCKS and s.check_most < p.gain_band * s.check_least:
        s.gain = s.followed_gain = s.known_gain = math.sqrt(s.check_least * s.check_most)


@kernel
def restart_gain(p: ControllerParams, s: ControllerMemory, events: int) -> None:
    """Forget the gain in a loop check, and after an operator's reset the gain learnt from a doubted accelerometer."""
    if s.guard_state == CHECKING:
        begin_gain(p, s)
    elif events & RESET and s.known_gain > 0.0:
        s.gain = s.followed_gain = s.accepted_share * s.known_gain


@kernel
def note_applied(p: ControllerParams, s: ControllerMemory, block: SensorRow) -> None:
    """Store the vibration that the rig applied in this block, and the loop delay: the age of its command."""
    applied_m = float(block.applied_m)
    if block.applied_Hz == 0.0:  # blocks of schema 1 and 2 do not state it
        applied_m = s.allowed_m
    elif math.fabs(block.applied_Hz - s.allowed_Hz) > _SAME_HZ:
        applied_m = 0.0  # tones of the loop check
    sequence: Any = np.int64(block.sequence)
    age = sequence - np.int64(block.applied_block) - 1
    if block.applied_Hz > 0.0 and block.fallback == 0:
        # by one step a block, as stalls change the delay for a moment
        s.loop_delay_steps += min(max(age - s.loop_delay_steps, -1), 1)
    slot, s.applied_mps = s.listened // p.slot_steps % SLOTS, math.tau * s.allowed_Hz * applied_m
    is_new_slot = s.listened % p.slot_steps == 0
    s.least_mps[slot] = s.applied_mps if is_new_slot else min(s.least_mps[slot], s.applied_mps)
    s.most_mps[slot] = s.applied_mps if is_new_slot else max(s.most_mps[slot], s.applied_mps)
    s.listened += 1


@kernel
def listen(p: ControllerParams, s: ControllerMemory) -> None:
    """Learn the gain from the v_a of this block, and doubt a gain that leaps down."""
    least_mps, most_mps, now_mps = s.least_mps.min(), s.most_mps.max(), s.vibration_velocity_mps
    if most_mps == 0.0:
        s.noise_mps += (p.learn_share if s.noise_mps > 0.0 else 1.0) * (now_mps - s.noise_mps)
    before, s.unexplained, s.resonates = s.unexplained, 0, 0
    noise_mps, doubted = _HEARD * s.noise_mps, s.doubted & ACCELEROMETER != 0
    if s.known_gain == 0.0 and most_mps > 0.0 and not doubted:
        steady = math.fabs(s.fast_mps - now_mps) < _STEADY * now_mps
        if now_mps > noise_mps and steady and s.applied_mps > 0.0:
            s.gain = s.followed_gain = s.known_gain = s.fast_mps / s.applied_mps
    if least_mps == 0.0 or s.known_gain == 0.0 or doubted:
        s.gain_off_s = s.low_s = 0.0
        return
    if now_mps > p.gain_leap * s.gain * most_mps:
        s.unexplained = 1
        if before == 1:  # a loose mount: at once, before less stroke hides it
            s.gain = max(s.gain, s.fast_mps / most_mps)
    elif p.gain_leap * now_mps < s.gain * least_mps:
        s.unexplained = -1
    explained = min(max(s.gain, (now_mps - noise_mps) / most_mps), now_mps / least_mps)
    s.gain = min(s.gain + p.learn_share * (explained - s.gain), s.known_gain / FIRST_SHARE)
    leaps = s.gain * p.gain_band < min(s.followed_gain, s.known_gain)
    high = s.gain > p.gain_leap * s.known_gain
    s.low_s = s.low_s + p.block_s if s.gain * p.gain_leap < s.accepted_share * s.known_gain else 0.0
    s.followed_gain += p.follow_share * (s.gain - s.followed_gain)
    s.gain_off_s = s.gain_off_s + p.block_s if leaps or high else 0.0
    if s.gain_off_s > HOLD_S and leaps:
        trip(s, OPEN_LOOP, ACCELEROMETER)
    s.resonates = 1 if s.gain_off_s > HOLD_S and high else 0


@kernel
def stroke(p: ControllerParams, s: ControllerMemory) -> None:
    """Set the amplitude [m] for the wanted v_a, and decide whether the exciter is at its end and too weak."""
    s.banded, s.at_limit = 0, 0
    if s.wanted_velocity_mps <= 0.0:
        s.wanted_m, s.weak_s = 0.0, 0.0
        return
    doubted, accepted = s.doubted & ACCELEROMETER != 0, s.accepted_share * s.known_gain
    gain = accepted if doubted and accepted > 0.0 else s.gain
    if gain < accepted / p.gain_band:
        gain, s.banded = accepted / p.gain_band, 1
    s.wanted_m = s.wanted_velocity_mps / (math.tau * p.frequency_Hz * gain)
    largest_m = min(p.amplitude_max_m, p.velocity_max_mps / (math.tau * p.frequency_Hz))
    unheard = s.known_gain == 0.0 and s.least_mps.min() > 0.0
    if s.wanted_m > largest_m or unheard or s.banded == 1 or doubted:
        s.at_limit = 1
    weak = s.at_limit == 1 and not doubted and s.vibration_velocity_mps < p.least_ratio * s.held_mps
    s.weak_s = s.weak_s + p.block_s if weak and s.in_force_s > 0.0 else 0.0
    begun = s.slip_began == 1 or s.stick_began == 1
    if weak and begun and s.banded == 1 and s.gain_off_s == 0.0 and is_settled(s, 0.0):
        # the contact shows that a warm exciter delivers no more than measured
        s.accepted_share = max(min(s.gain / s.known_gain, s.accepted_share), p.gain_floor)
