"""Limits of a rig file that protect less than usual: a report at the start of each run, for every key that protects."""

import math
from collections.abc import Collection

from bridge.guard.absent import lost_protection
from bridge.guard.config import GuardConfig, HeatConfig, Level
from bridge.guard.records import ExciterLimits

# Factor beyond which data of the exciter are reported: the rig files differ by 20. Smaller: sound exciters are reported.
# Larger: a wrong unit is not.
_FAR = 20.0
_USUAL = ExciterLimits(1e-7, 500.0, 5000.0, 1e-6, 1e-3, 20, 0.05)
_FASTEST_MPS = 1.0  # fastest drive of a machine
_LEVELS = ("velocity_ratio", "loud_ratio", "duty")
_WEAKER_IF_LARGER = ("band_hold_s", "duty_window_s", "drive_memory_s", "command_lost_s", "gain_change", "check_share")
_HEAT_IF_LARGER = ("stroke_m_per_V", "time_s", "rise_max_K", "alarm_share")
_HEAT_IF_SMALLER = ("capacitance_F", "loss_tangent", "resistance_K_per_W")


def protection(
    config: GuardConfig, exciter: ExciterLimits, fastest_drive_mps: float, absent: Collection[str]
) -> list[tuple[str, str]]:
    """Codes and texts of the events at the start of a run; arguments as in `wider`, and the channels that the rig lacks."""
    wide = wider(config, exciter, fastest_drive_mps)
    return ([("WIDE_LIMITS", wide)] if wide else []) + [("UNPROTECTED", text) for text in lost_protection(absent)]


def wider(config: GuardConfig, exciter: ExciterLimits, fastest_drive_mps: float) -> str:
    """The limits that protect less than usual, as text; empty without such a limit.

    Args:
        config, exciter: limits and exciter of the rig file.
        fastest_drive_mps: of the rig file, or of the simulated drive.

    """
    default, heat = GuardConfig(), HeatConfig()
    stroke = Level(alarm=exciter.stroke_m, abort=1.5 * exciter.stroke_m)
    ratio = default.velocity_ratio
    velocity = Level(alarm=ratio.alarm * fastest_drive_mps, abort=ratio.abort * fastest_drive_mps)
    levels: list[tuple[str, Level | None, Level]] = [
        ("stroke_m", config.stroke_m, stroke),
        ("velocity_mps", config.velocity_mps, velocity),
        *((name, getattr(config, name), getattr(default, name)) for name in _LEVELS),
    ]
    pairs: list[tuple[str, float, float]] = [  # key, value, largest usual value
        (f"{name}.{part}", getattr(level, part), getattr(usual, part))
        for name, level, usual in levels
        if level is not None
        for part in Level.model_fields
    ]
    pairs += [(name, getattr(config, name), getattr(default, name)) for name in _WEAKER_IF_LARGER]
    pairs.append(("fastest_drive_mps", fastest_drive_mps, _FASTEST_MPS))
    pairs += [(f"heat.{name}", getattr(config.heat, name), _FAR * getattr(heat, name)) for name in _HEAT_IF_LARGER]
    slew_m_per_s = exciter.slew_m_per_s or math.inf  # 0: no limit
    pairs += [
        ("piezo.amplitude_max_m", exciter.stroke_m, _FAR * _USUAL.stroke_m),
        ("piezo.amplitude_slew_m_per_s", slew_m_per_s, _FAR * _USUAL.slew_m_per_s),
        ("piezo.command_timeout_s", exciter.command_timeout_s, _FAR * _USUAL.command_timeout_s),
    ]
    smaller = [(f"heat.{name}", getattr(config.heat, name), getattr(heat, name) / _FAR) for name in _HEAT_IF_SMALLER]
    smaller.append(("exciter_gain", config.exciter_gain, default.exciter_gain / _FAR))
    weaker = [f"{key} = {value:g} (at most {usual:g})" for key, value, usual in pairs if value > usual * (1.0 + 1e-9)]
    return ", ".join(
        weaker + [f"{key} = {value:g} (at least {usual:g})" for key, value, usual in smaller if value < usual]
    )
