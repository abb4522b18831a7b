"""Estimates of the guard from the rig's samples: the velocity of the drive and of the vibration."""

import math

from bridge.guard.records import RING
from bridge.kernel import Record, kernel
from bridge.layouts import GuardMemory, GuardParams, SensorRow

_TWO_PI = 2.0 * math.pi
_PARTS = 5  # parts of the window for the drive's velocity
# Share of the drive's velocity up to which the slide sticks, and cannot be a witness. Smaller: a slide that creeps before it
# slips lowers the limits. Larger: an encoder with twice its scale passes as a stick. With 0.35, DRIVE_RATIO holds v_a at 1.3 v_d
# or more while a slide creeps.
_STICKS = 0.35
# Largest drive velocity over the velocity of its witness. Smaller: noise and ramps lower the limits. Larger: they rise as much.
_AGREES = 1.25


@kernel
def see_drive(p: GuardParams, s: GuardMemory, block: SensorRow) -> None:
    """Update the largest recent velocity of the drive [m/s], over 50 ms of its positions; it decays slowly.

    A position jump affects at most two of five parts of the 50 ms, so the velocity is limited to the median of the parts.
    """
    drive_m = _mean(block.drive_position_m)
    if not math.isfinite(drive_m):
        return
    at = s.seen_blocks % RING
    s.drive_m[at], s.slide_m[at] = drive_m, _mean(block.mass_position_m)
    s.drive_mps *= p.memory_keep
    s.announced_mps = max(s.announced_mps * p.announced_keep, s.newest_mps)
    back = min(p.window_blocks, s.seen_blocks)
    if back > 0:
        before = (s.seen_blocks - back) % RING
        velocity_mps = min(math.fabs(drive_m - s.drive_m[before]) / (back * p.block_s), _median(p, s, back))
        slide_mps = math.fabs(s.slide_m[at] - s.slide_m[before]) / (back * p.block_s)
        s.drive_mps = max(s.drive_mps, _agreed(s, velocity_mps, slide_mps))
    s.seen_blocks += 1


@kernel
def _mean(samples: Record) -> float:
    mean = 0.0
    for i in range(samples.shape[0]):
        mean += float(samples[i]) / samples.shape[0]
    return mean


@kernel
def _agreed(s: GuardMemory, drive_mps: float, slide_mps: float) -> float:
    """The velocity of the drive as far as the slide, unless it sticks, and the announcements, if any, agree with it [m/s].

    A stick cannot be distinguished from an encoder whose scale is wrong by a factor of 3 or more; `fastest_drive_mps` shows that.
    """
    if slide_mps > _STICKS * drive_mps:
        drive_mps = min(drive_mps, _AGREES * slide_mps)
    if s.newest_mps >= 0.0:
        drive_mps = min(drive_mps, _AGREES * s.announced_mps)
    return drive_mps


@kernel
def _median(p: GuardParams, s: GuardMemory, blocks: int) -> float:
    """Median velocity of the drive over the parts of its last blocks [m/s]; sets `fastest_mps` to the largest."""
    fastest_mps, second_mps, third_mps = 0.0, 0.0, 0.0
    newer = s.seen_blocks
    for part in range(1, _PARTS + 1):
        older = s.seen_blocks - blocks * part // _PARTS
        if older == newer:
            continue
        velocity_mps = math.fabs(s.drive_m[newer % RING] - s.drive_m[older % RING]) / ((newer - older) * p.block_s)
        if velocity_mps > fastest_mps:
            fastest_mps, second_mps, third_mps = velocity_mps, fastest_mps, second_mps
        elif velocity_mps > second_mps:
            second_mps, third_mps = velocity_mps, second_mps
        else:
            third_mps = max(third_mps, velocity_mps)
        newer = older
    s.fastest_mps = fastest_mps
    return third_mps


@kernel
def expect_drive(s: GuardMemory, velocity_mps: float) -> None:
    """Note an announced velocity of the drive: a vibration may begin before the move."""
    s.newest_mps = math.fabs(velocity_mps)
    s.drive_mps = max(s.drive_mps, s.newest_mps)


@kernel
def see_vibration(p: GuardParams, s: GuardMemory, block: SensorRow) -> None:
    """Update the velocity amplitude of the base [m/s] from its acceleration at the vibration frequency."""
    square = _square_at(block.base_accel_mps2, _TWO_PI * s.frequency_Hz * p.sample_s)
    if math.isfinite(square):
        s.square_mps2 += p.loud_share * (square - s.square_mps2)
    s.vibration_mps = math.sqrt(s.square_mps2) / (_TWO_PI * s.frequency_Hz)


@kernel
def _square_at(samples: Record, step_rad: float) -> float:
    """Square of the amplitude of the sine with `step_rad` per sample that fits the samples best.

    Not shared with the controller's equal fit: one error must not affect both.
    """
    c, sn, turn_c, turn_sn = 1.0, 0.0, math.cos(step_rad), math.sin(step_rad)
    cos_cos, cos_sin, sin_sin, with_cos, with_sin = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(samples.shape[0]):
        value = float(samples[i])
        cos_cos += c * c
        cos_sin += c * sn
        sin_sin += sn * sn
        with_cos += value * c
        with_sin += value * sn
        c, sn = c * turn_c - sn * turn_sn, sn * turn_c + c * turn_sn
    determinant = cos_cos * sin_sin - cos_sin * cos_sin
    if determinant < 1e-9:
        return 0.0
    a = (with_cos * sin_sin - with_sin * cos_sin) / determinant
    b = (with_sin * cos_cos - with_cos * cos_sin) / determinant
    return a * a + b * b
