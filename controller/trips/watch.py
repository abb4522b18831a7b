"""All trips, once a block: the checks before the policy, and after it the limits of the wanted v_a by a doubt."""

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory, ControllerParams
from bridge.wire.stickslip_pb2 import POSITIONS_APART
from controller.estimate.channels import is_noisy
from controller.estimate.windows import DRIVE as DRIVE_ROW
from controller.trips.consistency import watch_law
from controller.trips.doubts import CONTACT, DRIVE, SOME


@kernel
def watch(p: ControllerParams, s: ControllerMemory) -> None:
    """Detect faults in a block after its estimate, and hide doubted signals from the policy."""
    s.outside = 0 if p.travel_low_m <= s.last[DRIVE_ROW] <= p.travel_high_m else 1
    all_three = p.use_force == 1 and p.use_slide_position == 1
    if not all_three or (s.doubted & (CONTACT | DRIVE) != 0 and s.trip != POSITIONS_APART):
        s.evidence_s = 0.0
    elif s.steps % SOME == 0:
        watch_law(p, s)
    if s.doubted & (CONTACT | DRIVE) != 0:
        s.slip_began, s.stick_began = 0, 0
        s.blind = 1
        s.ratio = p.v_ratio  # false slips may have raised the ratio, and a false swing may have lowered it


@kernel
def restrain(s: ControllerMemory) -> None:
    """Restrain the policy: no vibration without v_d or outside of the travel."""
    if s.doubted & DRIVE or s.outside == 1:
        s.wanted_velocity_mps = 0.0
    elif s.most_drive_mps > 0.0 and (s.evidence_s > 0.0 or is_noisy(s)):
        s.wanted_velocity_mps = min(s.wanted_velocity_mps, s.ratio_now * s.most_drive_mps)
