"""All trips, once a block: the checks before the policy, and after it the limits of the wanted v_a by a doubt."""

import math

from bridge.kernel import Record, kernel
from bridge.layouts import ControllerMemory, ControllerParams, SensorRow
from bridge.wire.stickslip_pb2 import POSITIONS_APART
from controller.estimate.channels import is_noisy
from controller.estimate.windows import DRIVE as DRIVE_ROW
from controller.trips.consistency import watch_law
from controller.trips.doubts import CONTACT, DRIVE, SOME


@kernel
def watch(p: ControllerParams, s: ControllerMemory, block: SensorRow) -> None:
    """Detect faults in a block after its estimate, and hide doubted signals from the policy."""
    s.outside = 0 if p.travel_low_m <= s.last[DRIVE_ROW] <= p.travel_high_m else 1
    turn, all_three = s.steps % SOME, p.use_force == 1 and p.use_slide_position == 1
    if not all_three or (s.doubted & (CONTACT | DRIVE) != 0 and s.trip != POSITIONS_APART):
        s.evidence_s = 0.0
    elif turn == 0:
        watch_law(p, s)
    if turn == 3:
        _look_at_slide_accel(s, block.mass_accel_mps2)
    if s.doubted & (CONTACT | DRIVE) != 0:
        s.slip_began, s.stick_began = 0, 0
        s.blind = 1
        s.ratio[:] = p.v_ratio  # false slips may have raised the ratio, and a false swing may have lowered it


@kernel
def _look_at_slide_accel(s: ControllerMemory, samples: Record) -> None:
    total = 0.0
    for i in range(samples.shape[0]):
        total += float(samples[i])
    s.slide_accel_unread = 0 if math.isfinite(total) else 1


@kernel
def restrain(s: ControllerMemory) -> None:
    """Restrain the policy: no vibration without v_d or outside of the travel."""
    if s.doubted & DRIVE or s.outside == 1:
        s.wanted_velocity_mps = 0.0
    elif s.most_drive_mps > 0.0 and (s.evidence_s > 0.0 or is_noisy(s)):
        s.wanted_velocity_mps = min(s.wanted_velocity_mps, s.ratio_now * s.most_drive_mps)
