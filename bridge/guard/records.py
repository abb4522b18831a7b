"""The records of a guard: parameters derived once from the rig file, and the changing state."""

import math
from collections.abc import Collection
from typing import Any, NamedTuple

import numpy as np

from bridge.arrays import Records
from bridge.faults import Fault
from bridge.guard.absent import refusal
from bridge.guard.config import MOST_BANDS, ExciterConfig, GuardConfig, Level, merged_bands_Hz
from bridge.kernel import record
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.channels import CHANNELS

FIRST = wire.OVERTRAVEL  # arrays with an entry per limit begin with this limit
# limits with a level and a hold time
LIMITS = (*range(FIRST, wire.DUTY + 1), wire.DRIVE_FAST)
_LEVELS = wire.DRIVE_FAST - FIRST + 1  # length of an array with an entry per limit
MOST_TONES = 8  # most tones of a loop check
RING = 256  # stored block means of the drive's position: 64 ms of the shortest blocks, 0.25 ms; the window needs 50 ms
# Window of the velocities of drive and slide. Shorter: more noise. Longer: the velocity lags, so limits are too loose while the
# drive brakes.
DRIVE_WINDOW_S = 0.05
# Memory of the announced velocities over the memory of the measured ones. Shorter: a slower velocity, announced 1.3 s ahead,
# lowers the limits before the drive brakes. Longer: the announcements agree with a fast encoder for longer after a fast move.
_ANNOUNCED_PARTS = 4.0
_LOUD_FILTER_S = 0.01  # time constant of the measured v_a. Shorter: a slip that shakes the base counts as vibration
# Measured over stated velocity of the drive from which the guard trips. Smaller: overshoot and noise trip. Larger: an encoder
# with twice its scale does not.
_TOO_FAST = 1.5

PARAMS = np.dtype(
    [("run", "u8")]
    + [(name, "f8", (_LEVELS,)) for name in ("alarm", "abort")]
    + [("hold_blocks", "i8", (_LEVELS,))]
    + [
        (name, "f8")
        for name in (
            *("block_s", "sample_s", "slew_m_per_block", "frequency_min_Hz", "frequency_max_Hz"),
            *("loud_share", "memory_keep", "announced_keep", "duty_share"),
            *("heat_per_Hz_m2", "heat_share", "check_m", "gain_change", "exciter_gain"),
        )
    ]
    + [(name, "i8") for name in ("timeout_blocks", "lost_blocks", "window_blocks", "bands", "tones")]
    + [("band_Hz", "f8", (MOST_BANDS, 2)), ("tone_Hz", "f8", (MOST_TONES,))]
    + [("absent", "i8", (len(CHANNELS),))],  # 1: the rig has no such channel; 2: derived from others, which are checked
    align=True,
)

STATE = np.dtype(
    [
        (name, "i8")
        for name in (
            *("block", "state", "cause", "limit", "fresh", "heard", "last_sequence", "refused"),
            *("seen_blocks", "lost_blocks", "check_blocks", "verified", "frozen_channel"),
            *("loud_blocks", "ratio_blocks", "enable", "toggle"),
        )
    ]
    + [
        (name, "f8")
        for name in (
            *("frequency_Hz", "amplitude_m", "drive_mps", "fastest_mps", "vibration_mps", "square_mps2"),
            # announced velocities of the drive: the newest, -1 before the first, and the largest recent one
            *("heat", "duty", "quiet_mps2", "tone_mps2", "newest_mps", "announced_mps"),
        )
    ]
    + [("over_blocks", "f8", (_LEVELS,)), ("gain", "f8", (MOST_TONES,))]
    + [(name, "f8", (RING,)) for name in ("drive_m", "slide_m")]
    + [("accepted", "f8", (MOST_TONES,))]  # gains of the tones that later checks are compared with; 0: none yet
    + [(name, "f8", (len(CHANNELS),)) for name in ("lowest", "highest")],
    align=True,
)


class ExciterLimits(NamedTuple):
    """The exciter and its blocks, from the rig file."""

    stroke_m: float
    frequency_min_Hz: float
    frequency_max_Hz: float
    slew_m_per_s: float  # 0: no limit
    block_s: float
    samples_per_block: int
    command_timeout_s: float

    @classmethod
    def of(cls, exciter: ExciterConfig, block_s: float, samples_per_block: int) -> "ExciterLimits":
        """The limits of an exciter of a rig file, for blocks of this length."""
        return cls(
            exciter.amplitude_max_m,
            exciter.frequency_min_Hz,
            exciter.frequency_max_Hz,
            exciter.amplitude_slew_m_per_s,
            block_s,
            samples_per_block,
            exciter.command_timeout_s,
        )


def build(
    config: GuardConfig,
    exciter: ExciterLimits,
    run: int,
    arm: bool = False,
    absent: Collection[str] = (),
    derived: Collection[str] = (),
) -> tuple[Records, Records]:
    """Parameters and state of a guard at power-up.

    Raises Fault CONFIG if the limits lack the fastest drive or v_a, the loop check lacks an allowed tone, or the rig lacks a
    channel that the guard needs.

    Args:
        config, exciter: limits and exciter of the rig file.
        run: the number that each command must carry.
        arm: the rig is simulated, and its scenario arms it.
        absent: channels that the rig does not have.
        derived: channels that are derived from measured ones.

    """
    params = record(PARAMS)
    p: Any = params[0]
    p.run = run
    stroke = config.stroke_m or Level(alarm=exciter.stroke_m, abort=1.5 * exciter.stroke_m)
    if config.fastest_drive_mps is None or config.velocity_mps is None:
        raise Fault(
            "CONFIG",
            "guard.fastest_drive_mps, guard.velocity_mps: must be given for a real rig, in m/s; without them a wrong scale of "
            "the drive's encoder or of the accelerometer opens every other limit of v_a",
        )
    too_fast = Level(alarm=_TOO_FAST * config.fastest_drive_mps, abort=_TOO_FAST * config.fastest_drive_mps)
    heat = Level(alarm=config.heat.alarm_share, abort=1.0, hold_s=0.0)
    band = Level(alarm=0.5, abort=0.5, hold_s=config.band_hold_s)
    levels = stroke, config.velocity_mps, config.velocity_ratio, config.loud_ratio, band, heat, config.duty, too_fast
    for limit, level in zip(LIMITS, levels, strict=True):
        row = limit - FIRST
        p.alarm[row], p.abort[row] = level.alarm, level.abort
        p.hold_blocks[row] = round(level.hold_s / exciter.block_s)
    p.block_s, p.sample_s = exciter.block_s, exciter.block_s / exciter.samples_per_block
    p.slew_m_per_block = exciter.slew_m_per_s * exciter.block_s if exciter.slew_m_per_s > 0.0 else stroke.alarm
    p.frequency_min_Hz, p.frequency_max_Hz = exciter.frequency_min_Hz, exciter.frequency_max_Hz
    p.loud_share = 1.0 - math.exp(-exciter.block_s / _LOUD_FILTER_S)
    p.memory_keep = math.exp(-exciter.block_s / config.drive_memory_s)
    p.announced_keep = math.exp(-exciter.block_s / (_ANNOUNCED_PARTS * config.drive_memory_s))
    p.lost_blocks = round(config.command_lost_s / exciter.block_s)
    p.duty_share = 1.0 - math.exp(-exciter.block_s / config.duty_window_s)
    warm = config.heat
    losses_W = math.pi * warm.loss_tangent * warm.capacitance_F / warm.stroke_m_per_V**2  # losses over f u0^2 [W s/m^2]
    p.heat_per_Hz_m2 = losses_W * warm.resistance_K_per_W / warm.rise_max_K
    p.heat_share = 1.0 - math.exp(-exciter.block_s / warm.time_s)
    p.gain_change, p.exciter_gain = config.gain_change, config.exciter_gain
    p.check_m = config.check_share * stroke.alarm
    p.timeout_blocks = round(exciter.command_timeout_s / exciter.block_s)
    p.window_blocks = min(max(round(DRIVE_WINDOW_S / exciter.block_s), 2), RING - 1)
    bands_Hz = merged_bands_Hz(config.forbidden_Hz)
    p.bands = len(bands_Hz)
    for i, ends_Hz in enumerate(bands_Hz):
        p.band_Hz[i] = ends_Hz
    try:
        tones = config.tones_Hz(exciter.frequency_min_Hz, exciter.frequency_max_Hz)
    except ValueError as error:
        raise Fault("CONFIG", str(error)) from None
    p.tones = len(tones)
    p.tone_Hz[: len(tones)] = tones
    if reason := refusal(absent):
        raise Fault("CONFIG", reason)
    p.absent[:] = [1 if name in absent else 2 if name in derived else 0 for name in CHANNELS]

    state = record(STATE)
    s: Any = state[0]
    s.last_sequence, s.newest_mps = -1, -1.0
    s.frequency_Hz = exciter.frequency_max_Hz
    s.state, s.cause = (wire.ARMED, wire.ARMED_BY_SCENARIO) if arm else (wire.DISARMED, wire.POWER_UP)
    return params, state
