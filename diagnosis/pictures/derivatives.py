"""Motion of mass and spring of a reduced run from its channels; smooth derivatives on the 1 ms grid."""

import numpy as np
from scipy.ndimage import gaussian_filter1d

from bridge.arrays import Floats
from diagnosis.evidence.manifest import RigTable
from diagnosis.features.feature import Signals, scales_of
from diagnosis.features.grid import BLOCK_S
from diagnosis.gap.prepare import Prepared
from diagnosis.model.sensor_chain import low_pass

# Standard deviation of the smoothing, as a share of a slip. Too small: noise of the second derivative; too large: slips are cut.
# 0.14 is 5 ms on the paper's spring, where a slip keeps 90 % of its acceleration.
_SMOOTH_SHARE = 0.14
_SMOOTH_FREE = 5.0  # standard deviation with a force drive [blocks], where no slip gives a time scale
_FIRST_SHARE = 0.4  # share of this smoothing for a first derivative, which needs less
_SLOW_S = 0.08  # time constant of a high-pass at 2 Hz: accelerometers may begin at 0.5 Hz
_MOVES_MPS = 2e-3  # speed above which the mass has moved; a slip of the paper's rig reaches 22 mm/s


def smoothing_blocks(rig: RigTable) -> float:
    """Standard deviation [blocks] of the smoothing before signals are compared."""
    if rig.drive == "force":
        return _SMOOTH_FREE
    return float(np.clip(_SMOOTH_SHARE * scales_of(rig).slip_s / BLOCK_S, 1.0, 50.0))


def derivative(values: Floats, smooth_blocks: float) -> Floats:
    """Smoothed first derivative of `values` [blocks], in their unit per s."""
    return np.asarray(np.gradient(gaussian_filter1d(values, smooth_blocks), BLOCK_S), np.float64)


def second_derivative(values: Floats, smooth_blocks: float) -> Floats:
    """Smoothed second derivative of `values` [blocks], in their unit per s2; 0 at the ends.

    It uses differences: the truncated kernel of a smoothed derivative would keep a part of an offset of 0.5 m.
    """
    smooth = gaussian_filter1d(values, smooth_blocks, mode="nearest")
    result = np.zeros_like(smooth)
    result[1:-1] = (smooth[2:] - 2.0 * smooth[1:-1] + smooth[:-2]) / BLOCK_S**2
    return result


def without_slow(values: Floats) -> Floats:
    """`values` [blocks] without the part slower than 2 Hz."""
    return values - low_pass(values, _SLOW_S)


def with_drive_path(run: Prepared) -> Signals:
    """The signals, with the commanded path in place of a missing drive position."""
    if "drive_position_m" in run.signals:
        return run.signals
    path_m = np.cumsum(run.commands.drive) * BLOCK_S
    return run.signals | {"drive_position_m": path_m}


def motion(rig: RigTable, run: Prepared) -> dict[str, Floats]:
    """Variables over which a residual can be drawn, by name with unit, [blocks] each, as far as the channels give them."""
    signals = run.signals
    blocks = len(run.commands.drive)
    over: dict[str, Floats] = {"time_s": (np.arange(blocks, dtype=np.float64) + 0.5) * BLOCK_S}
    spring = rig.drive == "spring"
    smooth_first = _FIRST_SHARE * smoothing_blocks(rig)
    drive_m = with_drive_path(run)["drive_position_m"] if spring or "drive_position_m" in signals else None
    if drive_m is not None:
        over["drive_position_m"] = drive_m
    position_m = signals.get("mass_position_m")
    if position_m is None and spring and drive_m is not None and "drive_force_N" in signals:
        position_m = drive_m - signals["drive_force_N"] / (rig.drive_stiffness_N_per_m or 1.0)
    if position_m is not None:
        velocity_mps = derivative(position_m, smooth_first)
        over |= {"position_m": position_m, "velocity_mps": velocity_mps, "dwell_s": _since_motion_s(velocity_mps)}
        if drive_m is not None and spring:
            extension_m = drive_m - position_m
            force_N = signals.get("drive_force_N")
            if force_N is not None:
                # the zero of the extension is unknown, and chosen so that the spring law holds on average
                extension_m = extension_m - extension_m.mean() + force_N.mean() / (rig.drive_stiffness_N_per_m or 1.0)
            over["extension_m"] = extension_m
            over["extension_rate_mps"] = derivative(extension_m, smooth_first)
    if "drive_force_N" in signals:
        over["force_N"] = signals["drive_force_N"]
    if "mass_accel_mps2" in signals:
        over["acceleration_mps2"] = gaussian_filter1d(signals["mass_accel_mps2"], smooth_first)
    return over


def _since_motion_s(velocity_mps: Floats) -> Floats:
    """Time since the mass last moved faster than 2 mm/s, [blocks], s."""
    at = np.arange(len(velocity_mps), dtype=np.float64)
    last = np.maximum.accumulate(np.where(np.abs(velocity_mps) > _MOVES_MPS, at, 0.0))
    return (at - last) * BLOCK_S
