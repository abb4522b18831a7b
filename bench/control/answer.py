"""The controller's response to a block: announcements, false claims and sums over the run."""

import math

import numpy as np
import numpy.typing as npt

from bench.control.motion import natural_stick_s, put, put_stick
from bench.control.record import BLOCK_RING, CLAIMED, REASONS
from bridge.kernel import Record, kernel
from bridge.wire.stickslip_pb2 import EXCITE, PROBE, SLIP, STICK, STICK_SEEN

_SETTLED_S = 10.0  # time after the first announcement from which the energy is compared with the least possible
EXCITED = 0.05  # v_a / v_d above which the rig counts as vibrated
_START_S, _FIRST_LOOP_DELAYS = 0.15, 12.0  # time after a start for v_a to reach v_d; loop delays added at the first
_ABOVE, _TWICE = 1.3, 2.0  # limits of v_a over the wanted v_a, and over v_d; the time above them is counted
_EXACT = 1.0 - 1e-6  # share of v_d that v_a must reach: v_d is a difference of rounded positions
_STIFF_GRACE_S = 0.1  # time after a stick of a stiff axis in which its slip may announce it
_FOLLOWS = 0.5  # v_s / v_d above which a slide has ended its stick after a reversal
_CLAIM_GRACE_S = 0.02  # time after the slide last lagged in which a claimed stick is late, not false


@kernel
def announce(p: Record, s: Record, t: Record, shaking: bool, events: npt.NDArray[np.float64], count: int) -> int:
    """Write true sticks with their announcement, and claims of false sticks; return the number of events.

    Args:
        p, s: records of `bench.control.record`.
        t: the block's trace.
        shaking: whether the base vibrates.
        events, count: where events are written, and their number.

    """
    now_s = s.now_s
    if t.mode == EXCITE and s.mode != EXCITE:
        s.excite_begin_s = now_s
        s.excitations += 1
    stiff = natural_stick_s(p, s.speed_mps) < p.stiff_stick_s
    announced = t.state == STICK or t.mode == EXCITE or (stiff and t.state == SLIP)
    if announced and (s.stuck == 1 or s.pending == 1) and s.announced_s < 0.0:
        s.announced_s = now_s
    patience_s = _STIFF_GRACE_S if stiff else 2.0 * p.block_s
    if s.pending == 1 and (s.announced_s >= 0.0 or now_s - s.end_s > patience_s):
        count = put_stick(s, events, count)
    if announced and now_s >= p.enabled_from_s and s.first_s < 0.0:
        s.first_s = now_s
    claims = 1 if t.state == STICK or (t.mode == EXCITE and t.reason == STICK_SEEN) else 0
    if claims == 1 and s.claimed == 0 and not shaking and s.mode not in (EXCITE, PROBE):
        speed_mps = max(s.speed_mps, p.moves_mps)
        needs_s = min((p.seen_m2s / (speed_mps * speed_mps)) ** (1.0 / 3.0), 1.0)
        if now_s - s.dragged_s > 2.0 * needs_s + 3.0 * p.block_s + _CLAIM_GRACE_S:
            count = put(events, count, CLAIMED, now_s, t.state, t.mode, t.reason, s.speed_mps, 0.0)
    s.claimed, s.mode = claims, t.mode
    return count


@kernel
def add_up(p: Record, s: Record, t: Record, v_a_mps: float, error_m: float) -> None:
    """Add a block to the sums over the run.

    Args:
        error_m: distance by which the slide is behind the drive.

    """
    dt, v_d = p.block_s, s.speed_mps
    if s.moving == 0:
        s.standing_s += dt
    else:
        s.moving_s += dt
        s.error_square += error_m * error_m * dt
        s.error_peak_m = max(s.error_peak_m, math.fabs(error_m))
        if s.now_s >= p.enabled_from_s:
            _add_moving(p, s, t, v_a_mps, v_d)
    if 0 <= t.reason < REASONS and s.reason_s[t.reason] < 0.0:
        s.reason_s[t.reason] = s.now_s
        s.reason_moving_s[t.reason] = s.moving_s
        s.reason_excited_s[t.reason] = s.excited_s


@kernel
def _add_moving(p: Record, s: Record, t: Record, v_a_mps: float, v_d: float) -> None:
    dt = p.block_s
    s.enabled_moving_s += dt
    s.energy += v_a_mps * v_a_mps * dt
    s.drive_energy += v_d * v_d * dt
    excited_s = dt if v_a_mps > EXCITED * v_d else 0.0
    s.excited_s += excited_s
    if v_a_mps > _TWICE * s.fastest:  # a braking drive is not followed at once: its recent largest v_d counts
        s.twice_s += dt
    if t.reason == p.blind_reason:
        s.blind_s += dt
        s.blind_excited_s += excited_s
    if t.mode == PROBE:
        s.probe_s += dt
    if s.first_s >= 0.0 and s.now_s > s.first_s + _SETTLED_S:
        s.settled_s += dt
        s.settled_energy += v_a_mps * v_a_mps * dt
        s.settled_drive_energy += v_d * v_d * dt


@kernel
def follow_turn(p: Record, s: Record, error_m: float) -> None:
    """Measure, after a reversal, how long the slide rests and by how much its following error exceeds the mean of the stroke.

    Args:
        error_m: distance by which the slide is behind the drive.

    """
    if s.moving == 0:
        return
    if s.dir != s.turn_dir:
        if s.turn_dir != 0.0:
            end_stroke(s)
            s.turns += 1.0
            s.turn_s, s.follows_s = s.began_s, 0.0
            s.turn_peak_m, s.stroke_error, s.stroke_s = -math.inf, 0.0, 0.0
        s.turn_dir = s.dir
    if s.turns == 0.0:
        return
    stood_s = s.now_s - s.turn_s
    if s.follows_s == 0.0:
        s.turn_stick_s = max(s.turn_stick_s, stood_s)
        if s.v_mps > _FOLLOWS * s.speed_mps:
            s.follows_s = stood_s
    else:
        s.stroke_error += s.dir * error_m * p.block_s
        s.stroke_s += p.block_s
    if s.follows_s == 0.0 or stood_s <= 2.0 * s.follows_s:
        s.turn_peak_m = max(s.turn_peak_m, s.dir * error_m)


@kernel
def end_stroke(s: Record) -> None:
    """Update the largest quadrant error by the stroke since the last change of sign."""
    if s.stroke_s > 0.0:
        s.quadrant_m = max(s.quadrant_m, s.turn_peak_m - s.stroke_error / s.stroke_s)


@kernel
def follow_vibration(p: Record, s: Record, t: Record, v_a_mps: float, frequency_Hz: float, gain: float) -> None:
    """Count blocks in which v_a is below a v_d that the exciter can reach, and time above the wanted v_a.

    Args:
        gain: v_a for one metre of commanded amplitude [1/s].

    """
    dt, step_mps = p.block_s, p.slew_m_per_s * p.block_s * gain
    ring = s.blocks % BLOCK_RING
    v_d = min(s.speed_mps, s.drive_now_mps)  # for a drive that slows down, its present speed counts
    s.drive_mps[ring], s.wanted_mps[ring] = s.drive_now_mps, t.wanted_velocity_mps
    s.blocks += 1
    known = min(s.blocks, BLOCK_RING)
    # the v_d that a command in effect now can have measured, then the v_a that stroke and slew allow for it
    seen_mps = 0.0
    for i in range(min(p.late_blocks, known - 1), min(p.late_blocks + 2, known)):
        seen_mps = max(seen_mps, s.drive_mps[(ring - i) % BLOCK_RING])
    top_mps = gain * min(p.amplitude_max_m, p.velocity_max_mps / (2.0 * math.pi * frequency_Hz))
    reach_mps = s.reach_m * gain
    reach_mps = min(max(min(seen_mps, top_mps), reach_mps - step_mps), reach_mps + step_mps)
    s.reach_m = reach_mps / gain
    allowance_s = _START_S + (_FIRST_LOOP_DELAYS * p.late_blocks * dt if s.excitations <= 1 else 0.0)
    settled = s.now_s > max(s.excite_begin_s, s.began_s) + allowance_s
    if s.moving == 1 and t.mode == EXCITE and s.now_s >= p.enabled_from_s and settled and reach_mps >= v_d * _EXACT:
        s.covered += 1.0
        if v_a_mps < v_d * _EXACT:
            s.uncovered += 1.0
    # largest v_a that was wanted since the command in effect now was computed; it falls no faster than the slew
    wanted_mps = 0.0
    for i in range(min(p.late_blocks + 1, known)):
        wanted_mps = max(wanted_mps, s.wanted_mps[(ring - i) % BLOCK_RING])
    s.allowed_mps = max(wanted_mps, s.allowed_mps - step_mps)
    if v_a_mps > max(_ABOVE * s.allowed_mps, 1e-9):
        s.above_now_s += dt
        if s.above_now_s > s.above_s:
            s.above_s = s.above_now_s
            s.above_at_s = s.now_s - s.above_now_s
    else:
        s.above_now_s = 0.0
