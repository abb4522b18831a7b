"""All trips, once a block: the checks before the policy, and after it the limits of the wanted v_a by a doubt."""

import math

from bridge.kernel import Record, kernel
from bridge.layouts import ControllerMemory, ControllerParams, SensorRow
from controller.estimate.windows import DRIVE as DRIVE_ROW
from controller.trips.confirmed import watch_confirmed
from controller.trips.delivered import SOME, watch_delivered, watch_rest
from controller.trips.doubts import ACCELEROMETER, CONTACT, DRIVE, OF_DRIVE
from controller.trips.frozen import watch_frozen
from controller.trips.noise import watch_slips
from controller.trips.spring import is_drive_off, watch_spring


@kernel
def watch(p: ControllerParams, s: ControllerMemory, block: SensorRow) -> None:
    """Detect faults in a block after its estimate, and hide doubted signals from the policy."""
    watch_frozen(p, s, block)
    watch_delivered(p, s, block)
    s.slip_count += s.slip_began
    place_m = s.first_sample[OF_DRIVE]
    s.outside = 0 if p.travel_low_m <= place_m <= p.travel_high_m else 1
    turn, all_three = s.steps % SOME, p.use_force == 1 and p.use_slide_position == 1 and s.jumped_s == 0.0
    if turn == 0 and all_three and s.doubted & (CONTACT | DRIVE) == 0:
        watch_spring(p, s)
    elif turn == 1:
        watch_rest(p, s, block)
    elif turn == 2:
        watch_slips(p, s)
    elif turn == 3:
        _look_at_slide_accel(s, block.mass_accel_mps2)
        if all_three:
            watch_confirmed(p, s)
    s.gain_other_s = max(s.gain_other_s - p.block_s, 0.0)
    doubted = s.doubted & (CONTACT | DRIVE) != 0 or s.unbelieved_s > 0.0
    if doubted or s.broken_steps > 0:
        s.slip_began, s.stick_began = 0, 0
    if doubted:
        s.blind = 1
        s.ratio[:] = p.v_ratio  # false slips may have raised the ratio, and a false swing may have lowered it


@kernel
def _look_at_slide_accel(s: ControllerMemory, samples: Record) -> None:
    total = 0.0
    for i in range(samples.shape[0]):
        total += float(samples[i])
    s.slide_accel_unread = 0 if math.isfinite(total) else 1


@kernel
def restrain(p: ControllerParams, s: ControllerMemory) -> None:
    """Restrain the policy: no vibration without v_d or outside of the travel, no frequency without a known gain."""
    if s.doubted & DRIVE or s.outside == 1:
        s.wanted_velocity_mps = 0.0
    elif is_drive_off(s) or s.jumped_s > 0.0:
        s.wanted_velocity_mps = s.ratio_now * math.fabs(s.kept_mps[DRIVE_ROW])
    else:
        s.wanted_velocity_mps *= s.confirmed
    if s.doubted & ACCELEROMETER and s.followed >= 0 and s.wanted_Hz != p.candidate_Hz[s.followed]:
        s.candidate, s.wanted_Hz = s.followed, p.candidate_Hz[s.followed]
