"""Reset after a fault of force or position: values learnt from a wrong channel are forgotten.

Windows, noise, stiffness, forces, and the speeds at which a vibration was needed or not are learnt again, as at a start. Values
of exciter, loop delay and accelerometer stay: they do not depend on the doubted channels.
"""

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory, ControllerParams
from controller.estimate.compliance import begin_spring
from controller.estimate.windows import clear_windows


@kernel
def forget_motion(p: ControllerParams, s: ControllerMemory) -> None:
    """Forget all values learnt from force and positions."""
    clear_windows(s)
    for table in (s.slope, s.sigma, s.noise):
        table[:, :] = 0.0
    s.slope_before[:, :, :] = 0.0
    s.law_mps[:], s.resolution[:], s.kept_mps[:], s.kept_m_per_N = 0.0, 0.0, 0.0, 0.0
    s.bends[:], s.agreements[:], s.differences[:] = 0.0, 0, 0
    s.looks[:, :], s.lively[:, :], s.first_seen = 0, 0.0, 0
    s.bend_m, s.bent, s.noise_told_s, s.unbelieved_s, s.slip_count, s.slips_wound = 0.0, 0, 0.0, 0.0, 0.0, 0.0
    _forget_velocities(s)
    _forget_forces(p, s)
    forget_needs(p, s)


@kernel
def _forget_velocities(s: ControllerMemory) -> None:
    s.drive_velocity_mps, s.held_mps, s.rising_mps, s.steady_mps = 0.0, 0.0, 0.0, 0.0
    s.steady_s, s.moved_s, s.stood_s = 0.0, 0.0, 0.0
    s.measured, s.moving, s.blind = 0, 0, 0
    s.sliding_mps, s.fine_mps, s.fine_sigma_mps = 0.0, 0.0, 0.0
    s.level, s.swing_level, s.slipping = -1, -1, 0
    s.stick_s, s.since_stick_s, s.smooth_s, s.unseen_s = 0.0, 0.0, 0.0, 0.0


@kernel
def _forget_forces(p: ControllerParams, s: ControllerMemory) -> None:
    begin_spring(p, s)
    s.stretched = 0
    s.peak_N, s.slip_from_N = 0.0, 0.0
    for force_N in (s.swing_N, s.breakaway_N, s.sliding_N, s.slid_N):
        force_N[:] = 0.0
    s.dragged[:] = 0


@kernel
def forget_needs(p: ControllerParams, s: ControllerMemory) -> None:
    """Forget where a vibration was needed, was not, or did not help: some may have been learnt with the exciter off."""
    for needs in (s.edge_ratio, s.edge_held_s, s.untried_s, s.needed_to_mps, s.needless_from_mps):
        needs[:] = 0.0
    s.ratio[:] = p.v_ratio
    s.off_s[:], s.off_left_s[:], s.fall_with_N[:], s.crest_with_N[:] = 0.0, 0.0, 0.0, 0.0
    s.swing, s.even_s, s.lead, s.top = 0.0, 0.0, 0.0, -1.0
    s.failed, s.failed_left_s, s.proven[:] = 0, 0.0, 0
