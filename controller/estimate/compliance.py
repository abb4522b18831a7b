"""The compliance c = 1 / k_d of the drive's spring with its error, from x_d' - x_s' = c F'; and v_s by force and position.

An axis of unknown stiffness has an infinite sigma of c, so its force gives no velocity. An axis too stiff for its positions has
c near 0 with a small absolute sigma, and its force gives v_s although k_d itself is never known.
"""

import math

from bridge.kernel import hypot, kernel
from bridge.layouts import ControllerMemory, ControllerParams
from controller.estimate.windows import DRIVE, FEWEST, FORCE, SIGMAS, SLIDE

_GIVEN_SIGMA = 0.5  # relative sigma of a configured stiffness: a data sheet without bearings and couplings
# Least relative sigma of c, and of c in one window: the mass of the slide and the lag of the sensors bend the law. A configured
# stiffness has it where only the force shows the slide. Smaller: one fast slip outweighs a hundred sticks.
_LEAST_SIGMA = 0.05
_STUCK = 0.1  # largest v_s / v_d of a stuck slide
_FORGETS_S = 20.0  # time constant, of windows that show c, with which earlier windows are forgotten
_LEARNT = 0.1  # largest relative sigma of a learnt c


@kernel
def begin_spring(p: ControllerParams, s: ControllerMemory) -> None:
    """Start from the configured stiffness; without one, c is unknown."""
    s.direction = 1
    s.shown, s.shown_c, s.shown_square, s.shown_windows, s.stiffness_learnt = 0.0, 0.0, 0.0, 0.0, 0
    if p.drive_stiffness_N_per_m > 0.0:
        s.compliance_m_per_N = 1.0 / p.drive_stiffness_N_per_m
        s.compliance_sigma = _GIVEN_SIGMA * s.compliance_m_per_N
    else:
        s.compliance_m_per_N, s.compliance_sigma = 0.0, math.inf


@kernel
def learn_compliance(p: ControllerParams, s: ControllerMemory, tick_s: float) -> None:
    """Learn c from the window with the least error of c, from rates, so that offsets cancel."""
    if p.use_force == 0 or p.use_slide_position == 0:
        return
    best, variance = -1, math.inf
    for level in range(p.levels):
        # drift over seconds, and hum in windows of about its period, exceed the extrapolated white noise and look like a spring
        if s.differences[level] < FEWEST:
            break
        force, slide, drive = s.noise[FORCE, level], s.noise[SLIDE, level], s.noise[DRIVE, level]
        rate, drive_mps, slide_mps = s.slope[FORCE, level], s.slope[DRIVE, level], s.slope[SLIDE, level]
        # hum of the force in windows that show no motion would make every spring stiff; a slide position that never changes by a
        # step is not connected, and would make every spring soft
        moves = math.fabs(drive_mps) > SIGMAS * drive or math.fabs(slide_mps) > SIGMAS * slide
        if slide > 0.0 and moves and math.fabs(rate) > SIGMAS * force:
            by_force = s.compliance_m_per_N * force
            now = (slide * slide + drive * drive + by_force * by_force) / (rate * rate)
            if now < variance:
                best, variance = level, now
    if best < 0 or (s.stiffness_learnt == 1 and not _is_stuck(s, best)):
        return
    c = (s.slope[DRIVE, best] - s.slope[SLIDE, best]) / s.slope[FORCE, best]
    least = _LEAST_SIGMA * max(math.fabs(c), s.compliance_m_per_N)
    weight = 1.0 / (variance + least * least)
    share = min(tick_s / p.window_s[best], 1.0)  # successive windows overlap
    keep = 1.0 - tick_s / _FORGETS_S
    s.shown = keep * s.shown + share * weight
    s.shown_c = keep * s.shown_c + share * weight * c
    s.shown_windows = keep * s.shown_windows + share
    mean = s.shown_c / s.shown
    s.shown_square = keep * s.shown_square + share * weight * (c - mean) * (c - mean)
    wider = max(s.shown_square / s.shown_windows, 1.0)  # windows that scatter by more than their errors
    sigma = hypot(math.sqrt(wider / s.shown), _LEAST_SIGMA * mean)
    given = s.stiffness_learnt == 0 and math.isfinite(s.compliance_sigma) and p.drive_stiffness_N_per_m > 0.0
    if s.shown_windows > 1.0 and (not given or sigma < _GIVEN_SIGMA * math.fabs(mean)):
        s.compliance_m_per_N, s.compliance_sigma = max(mean, 0.0), sigma
        s.stiffness_learnt = 1 if sigma < _LEARNT * mean else s.stiffness_learnt


@kernel
def _is_stuck(s: ControllerMemory, level: int) -> bool:
    """Whether the slide sticks on a moving drive: only this refines a learnt c, as a wrong position would soften it."""
    drive_mps = math.fabs(s.slope[DRIVE, level])
    return drive_mps > SIGMAS * s.noise[DRIVE, level] and math.fabs(s.slope[SLIDE, level]) < _STUCK * drive_mps


@kernel
def spring_force(s: ControllerMemory, elongation_m: float) -> float:
    """The elongation of the spring in place of its force, for a rig without a force sensor; N for a known c, else m.

    The spring is assumed to be relaxed at the start; once the slide was dragged both ways, half-way between the largest
    elongations of both directions, as friction is alike in both.
    """
    if s.stretched == 0:
        s.shortest_m, s.longest_m, s.stretched = elongation_m, elongation_m, 1
        s.relaxed_m = elongation_m
    s.shortest_m, s.longest_m = min(s.shortest_m, elongation_m), max(s.longest_m, elongation_m)
    if s.dragged[0] == 1 and s.dragged[1] == 1:
        s.relaxed_m = 0.5 * (s.shortest_m + s.longest_m)
    return (elongation_m - s.relaxed_m) / (s.compliance_m_per_N if s.compliance_m_per_N > 0.0 else 1.0)


@kernel
def elongation_m(p: ControllerParams, s: ControllerMemory, force_N: float) -> float:
    """Elongation of the spring by a force [m]; by the error of c where it exceeds c, so infinite while c is unknown."""
    if p.use_force == 0:
        return math.fabs(force_N) * (s.compliance_m_per_N if s.compliance_m_per_N > 0.0 else 1.0)
    return math.fabs(force_N) * max(s.compliance_m_per_N, s.compliance_sigma) if force_N != 0.0 else 0.0


@kernel
def slide_mps(p: ControllerParams, s: ControllerMemory, level: int, speed_mps: float) -> tuple[float, float]:
    """v_s along the drive's direction and its sigma in a window [m/s], from position and force weighted by their errors.

    Sigma is infinite without either. The velocity by force, v_d - c F', has the errors of F', c and v_d.
    """
    noise_mps, noise_N_per_s, rate_N_per_s = s.noise[SLIDE, level], s.noise[FORCE, level], s.slope[FORCE, level]
    place_mps = s.direction * s.slope[SLIDE, level]
    force_mps = speed_mps - s.direction * s.compliance_m_per_N * rate_N_per_s
    has_place = p.use_slide_position == 1 and noise_mps > 0.0
    weight_x = 1.0 / (noise_mps * noise_mps) if has_place else 0.0
    weight_F = 0.0
    if p.use_force == 1 and noise_N_per_s > 0.0 and math.isfinite(s.compliance_sigma):
        least_sigma = _LEAST_SIGMA * s.compliance_m_per_N
        sigma_c = (
            s.compliance_sigma if has_place else min(s.compliance_sigma, least_sigma)
        )  # nothing else shows the slide
        # sigma_c counts with the noise of F', too: else a force without a rate would show an exact velocity
        by_compliance = sigma_c * max(math.fabs(rate_N_per_s), noise_N_per_s)
        sigma_mps = hypot(hypot(by_compliance, s.drive_velocity_sigma_mps), s.compliance_m_per_N * noise_N_per_s)
        weight_F = 1.0 / max(sigma_mps * sigma_mps, 1e-24)
        # a configured stiffness that the position contradicts: k_d ten times too large hides 15 sticks of 17 on 20 N/um
        if (
            has_place
            and s.stiffness_learnt == 0
            and math.fabs(place_mps - force_mps) > SIGMAS * hypot(noise_mps, sigma_mps)
        ):
            weight_F = 0.0
    weight = weight_x + weight_F
    if weight == 0.0:
        return 0.0, math.inf
    return (weight_x * place_mps + weight_F * force_mps) / weight, 1.0 / math.sqrt(weight)
