"""Test whether friction falls with speed, by a small wobble of v_a while the vibration holds the slide.

Friction under vibration is a mean over speeds from v_a - v_s to v_a + v_s. If friction is the same at every speed, this mean
depends on v_a / v_s alone, as no other quantity is a velocity. So at a given force of the spring v_s changes by the same share as
v_a. If friction falls with speed, more v_a reduces friction further, and v_s changes by more. Such a slide sticks or runs ahead
when the vibration ends, and the wobble shows this without ending it.

The force must be constant: the wobble must be faster than the spring takes up the change of friction. v_a and v_s are measured
at the frequency of the wobble, under a Hann window, so that a slow trend of v_s does not count.
"""

import math

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory, ControllerParams
from controller.estimate.windows import BINS, FORCE, SLIDE

TWO_PI = 2.0 * math.pi
DEPTH = 0.08  # amplitude of the wobble over v_a: a ratio of 1.2 falls to 1.10
# Ratios about which v_a wobbles. Lower: v_a is near v_s, which then changes by more. Higher: falling friction has less effect.
LEAST_ASKED, MOST_ASKED = 1.2, 1.3
PERIODS = 4.0  # periods of the wobble after which its result is judged: a round
_NOISE = 0.02  # largest noise of v_s over v_d in the used windows: a quarter of the wobble
_WINDOWS, _BLOCKS = 6.0, 8.0  # fewest windows and blocks in a period: a window then attenuates the wobble by 3 %
_EXCITER_PERIODS = 2.0  # fewest periods of the exciter in a window
_SMOOTHED = 0.973  # share of a wobble that passes windows of a sixth of its period
# Limits of (relative change of v_s) / (relative change of v_a). Above the first, friction falls with speed; below the second, it
# does not. Values between them are judged by the third after some rounds. Measured on the test bank: PTFE 0.98 to 1.03, steel
# from 1.03 at 1.5 mm/s to 1.5 at 0.3 mm/s on a soft drive.
_FALLS, _EVEN, _LAST = 1.035, 1.01, 1.02
_MOST_ROUNDS = 3.5  # number of rounds after which the third limit decides
EVEN, UNSURE, FALLS = range(3)
_ASIDE = 0.25  # largest response a quarter period out of phase, over v_s / v_a; above, v_s has another cause


@kernel
def can_ask(p: ControllerParams, longest_s: float) -> bool:
    """Whether the shortest windows and the blocks allow a wobble with a period of at most `longest_s`."""
    return max(_WINDOWS * p.window_s[0], _BLOCKS * p.block_s) <= longest_s


@kernel
def windows_for(p: ControllerParams, s: ControllerMemory, speed_mps: float) -> int:
    """The level of the shortest windows with a small enough noise of v_s; -1: no level."""
    for level in range(p.levels):
        if s.pushed[level] < BINS:
            return -1
        if p.window_s[level] * s.allowed_Hz >= _EXCITER_PERIODS and slide_noise_mps(p, s, level) <= _NOISE * speed_mps:
            return level
    return -1


@kernel
def begin_wobble(p: ControllerParams, s: ControllerMemory, speed_mps: float, longest_s: float) -> bool:
    """Begin a wobble if windows with a small enough noise of v_s fit into a period of at most `longest_s`."""
    level = windows_for(p, s, speed_mps)
    if level < 0:
        return False
    period_s = max(_WINDOWS * p.window_s[level], _BLOCKS * p.block_s)
    if period_s > longest_s:
        return False
    s.wobble_level, s.wobble_period_s, s.wobble_s, s.wobbles = level, period_s, 0.0, 1
    s.wobble_a[:] = 0.0
    s.wobble_v[:] = 0.0
    return True


@kernel
def wobble_factor(s: ControllerMemory) -> float:
    """Present factor of the wobble on v_a; 1 without a wobble."""
    return 1.0 + DEPTH * math.cos(TWO_PI * s.wobble_s / s.wobble_period_s) if s.wobbles == 1 else 1.0


@kernel
def wobble(p: ControllerParams, s: ControllerMemory, speed_mps: float) -> bool:
    """Add a block's v_a and v_s; return whether a round is complete: after each `PERIODS`."""
    turn_rad = TWO_PI * s.wobble_s / s.wobble_period_s
    # angle from the middle of the window of v_s to the middle of the block of v_a
    late_rad = math.pi * (p.window_s[s.wobble_level] - p.block_s) / s.wobble_period_s
    weight = 1.0 - math.cos(turn_rad / PERIODS)
    v_s = weight * slide_mps(p, s, s.wobble_level, speed_mps)
    s.wobble_a[0] += weight * s.fast_mps * math.cos(turn_rad)
    s.wobble_a[1] += weight * s.fast_mps * math.sin(turn_rad)
    s.wobble_v[0] += v_s * math.cos(turn_rad - late_rad)
    s.wobble_v[1] += v_s * math.sin(turn_rad - late_rad)
    s.wobble_a[2] += weight * s.fast_mps
    s.wobble_v[2] += v_s
    s.wobble_s += p.block_s
    rounds = s.wobble_s / (PERIODS * s.wobble_period_s)
    return rounds - math.floor(rounds) < p.block_s / (PERIODS * s.wobble_period_s)


@kernel
def answer(s: ControllerMemory) -> int:
    """Result of the wobble: FALLS if v_s changes by more than v_a or has another cause; EVEN; or UNSURE: continue.

    The mass of the slide delays the response by 1 / (1 + j x). The response without mass is the squared magnitude over the
    in-phase part.
    """
    a, v = s.wobble_a, s.wobble_v
    asked = a[0] * a[0] + a[1] * a[1]
    with_it = (a[0] * v[0] + a[1] * v[1]) / asked
    aside = (a[0] * v[1] - a[1] * v[0]) / asked
    each = _SMOOTHED * v[2] / a[2]
    if with_it <= 0.0 or math.fabs(aside) > _ASIDE * v[2] / a[2]:
        return FALLS
    share = (with_it + aside * aside / with_it) / each
    if share > _FALLS:
        return FALLS
    if share < _EVEN:
        return EVEN
    if s.wobble_s < _MOST_ROUNDS * PERIODS * s.wobble_period_s:
        return UNSURE
    return FALLS if share > _LAST else EVEN


@kernel
def slide_noise_mps(p: ControllerParams, s: ControllerMemory, level: int) -> float:
    """Noise of v_s in a window [m/s]."""
    weight = _weight_by_place(p, s, level) + _weight_by_force(p, s, level)
    return 1.0 / math.sqrt(weight) if weight > 0.0 else math.inf


@kernel
def slide_mps(p: ControllerParams, s: ControllerMemory, level: int, speed_mps: float) -> float:
    """v_s in a window [m/s], from position and force, weighted by their noise."""
    by_place, by_force = _weight_by_place(p, s, level), _weight_by_force(p, s, level)
    place_mps = s.direction * s.slope[SLIDE, level]
    force_mps = speed_mps - s.direction * s.slope[FORCE, level] / s.stiffness_N_per_m
    return (by_place * place_mps + by_force * force_mps) / (by_place + by_force)


@kernel
def _weight_by_place(p: ControllerParams, s: ControllerMemory, level: int) -> float:
    noise_mps = s.noise[SLIDE, level]
    return 1.0 / (noise_mps * noise_mps) if p.use_slide_position == 1 and noise_mps > 0.0 else 0.0


@kernel
def _weight_by_force(p: ControllerParams, s: ControllerMemory, level: int) -> float:
    noise_mps = s.noise[FORCE, level] / s.stiffness_N_per_m
    return 1.0 / (noise_mps * noise_mps) if p.use_force == 1 and noise_mps > 0.0 else 0.0
