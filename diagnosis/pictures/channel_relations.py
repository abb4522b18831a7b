"""Relations between channels that hold for any friction, and one relation with the friction law; no fit, no simulation.

A relation that fails shows which part of the rig or of the measurement differs from its description. The variable over which it
fails shows the effect. Every residual has a noise: the measured noise of the channels, and the errors of ordinary sensors.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter1d, minimum_filter1d

from bridge.arrays import Floats
from diagnosis.evidence.manifest import RigTable
from diagnosis.features.feature import RESOLVED_M, Signals
from diagnosis.features.grid import BLOCK_S
from diagnosis.gap.prepare import Prepared
from diagnosis.pictures.derivatives import (
    derivative,
    motion,
    second_derivative,
    smoothing_blocks,
    with_drive_path,
    without_slow,
)
from diagnosis.relations.relation import kept_blocks

# Error of an ordinary measuring chain in each relation, as a share of the signal in the relation (rms, or peak to peak in
# `_spring`). Too small: good sensors stand out; too large: effects do not. Displacement sensors are linear to 0.2 to 0.4 % in
# slope, a force channel lags by 40 us (0.35 % of a slip on the paper's spring), a displacement channel by up to 200 us (1.8 %),
# and an accelerometer that begins at 0.5 Hz loses 1 % of a slip.
_SPRING_SHARE = 0.002
_CURVATURE_SHARE = 0.012
_MOTION_SHARE = 0.04
_DRIVE_SHARE = 0.002
_ROUGH_SHARE = 0.006  # scatter of the friction on a rough surface, as a share of the friction
_EXCITER_SHARE = 0.01
_ROLLED_OFF = 0.5  # roll-off of ordinary accelerometers, see `accel_rolled_off` in `diagnosis.model.sensor_chain`
_VIBRATION_BLOCKS = 20  # blocks for each point of the exciter's relation
_SLIDES_FROM = (
    2.0  # lowest speed at which the friction law holds, in Stribeck velocities; below, presliding sets the force
)
_EDGE_MARGIN = 3.0  # distance from the edges of a slip, in standard deviations of the smoothing


class Residual(NamedTuple):
    """Residual of a relation along a run. Arrays are [points]."""

    name: str  # spring, curvature, motion, exciter, drive, friction
    values: Floats  # 0 where the relation holds, in the unit of the relation
    noise: float  # standard deviation of the noise
    over: dict[str, Floats]  # variables that could explain the residual, by name with unit

    @property
    def rms(self) -> float:
        """Root mean square in units of the noise; about 1 where the relation holds."""
        return float(np.sqrt(np.mean(self.values**2))) / self.noise


def parity_residuals(rig: RigTable, run: Prepared) -> tuple[Residual, ...]:
    """The residuals that can be computed from the channels of a run; `rig` should hold the numbers of the baseline."""
    residuals: list[Residual | None] = []
    if rig.drive == "spring":
        residuals += [_spring(rig, run), _curvature(rig, run), _exciter(run), _drive(rig, run)]
    residuals += [_motion(rig, run), _friction(rig, run)]
    return tuple(residual for residual in residuals if residual is not None and len(residual.values) > 1)


def _noise_signals(run: Prepared) -> Signals:
    """Measured noise of every channel, [blocks of the run] each."""
    random = np.random.default_rng(1)
    blocks = len(run.commands.drive)
    return {name: run.noise.drawn(name, blocks, random) for name in run.signals}


def _residual(
    name: str,
    rig: RigTable,
    run: Prepared,
    values: Floats,
    noise: Floats,
    sensor_error: float,
    without_vibration: bool = False,
) -> Residual:
    """A residual without the blocks around changes of command.

    Args:
        name: name of the relation.
        rig: rig for the variables of `over`.
        run: run with the commands and the variables.
        values: the residual, [blocks].
        noise: the relation applied to measured noise, [blocks].
        sensor_error: standard deviation of sensor errors that the measured noise does not hold.
        without_vibration: whether blocks under vibration are left out too.

    """
    kept = kept_blocks(run)
    if without_vibration:
        kept &= run.commands.frequency_Hz == 0.0
    spread = float(np.sqrt(np.mean(noise[kept] ** 2) + sensor_error * sensor_error)) if kept.any() else 1.0
    over = {key: column[kept] for key, column in motion(rig, run).items()}
    return Residual(name, values[kept], spread, over)


def _spring(rig: RigTable, run: Prepared) -> Residual | None:
    if not {"drive_force_N", "mass_position_m", "drive_position_m"} <= run.signals.keys():
        return None

    def relation(signals: Signals) -> Floats:
        extension_m = signals["drive_position_m"] - signals["mass_position_m"]
        rate_mps = derivative(extension_m, 2.0)
        spring_N = (rig.drive_stiffness_N_per_m or 0.0) * extension_m + (rig.drive_damping_Ns_per_m or 0.0) * rate_mps
        left = signals["drive_force_N"] - spring_N
        return left - left.mean()  # the zero between the two displacement sensors is not known

    force_N = run.signals["drive_force_N"]
    return _residual(
        "spring", rig, run, relation(run.signals),
        relation(_noise_signals(run)), _SPRING_SHARE * float(np.ptp(force_N)),
    )  # fmt: skip


def _curvature(rig: RigTable, run: Prepared) -> Residual | None:
    if not {"drive_force_N", "mass_accel_mps2"} <= run.signals.keys():
        return None
    smooth = smoothing_blocks(rig)

    def relation(signals: Signals) -> tuple[Floats, Floats]:
        bent = second_derivative(signals["drive_force_N"], smooth)
        apart = gaussian_filter1d(signals["mass_accel_mps2"], smooth)
        apart = apart - second_derivative(signals["drive_position_m"], smooth)
        change = np.gradient(apart, BLOCK_S)
        spring = (rig.drive_stiffness_N_per_m or 0.0) * apart + (rig.drive_damping_Ns_per_m or 0.0) * change
        return without_slow(-bent - spring), without_slow(bent)

    values, bent = relation(with_drive_path(run))
    noise = _noise_signals(run)
    noise.setdefault("drive_position_m", np.zeros_like(values))
    return _residual(
        "curvature", rig, run, values,
        relation(noise)[0], _CURVATURE_SHARE * float(bent.std()), without_vibration=True,
    )  # fmt: skip


def _motion(rig: RigTable, run: Prepared) -> Residual | None:
    if not {"mass_accel_mps2", "mass_position_m"} <= run.signals.keys():
        return None
    smooth = smoothing_blocks(rig)

    def relation(signals: Signals) -> tuple[Floats, Floats]:
        accel_mps2 = gaussian_filter1d(signals["mass_accel_mps2"], smooth)
        apart = accel_mps2 - second_derivative(signals["mass_position_m"], smooth)
        return without_slow(apart), without_slow(accel_mps2)

    values, accel_mps2 = relation(run.signals)
    return _residual(
        "motion", rig, run, values,
        relation(_noise_signals(run))[0], _MOTION_SHARE * float(accel_mps2.std()), without_vibration=True,
    )  # fmt: skip


def _drive(rig: RigTable, run: Prepared) -> Residual | None:
    if "drive_position_m" not in run.signals:
        return None
    kept = kept_blocks(run)
    values = np.zeros(len(kept))
    for segment in run.commands.segments:
        at = np.arange(segment.first, segment.last)[kept[segment.first : segment.last]]
        if len(at) > 100:
            path_m = run.signals["drive_position_m"][at]
            # subtracting a parabola removes the bow of the displacement sensor
            values[at] = path_m - np.polynomial.Polynomial.fit(at, path_m, 2)(at)
    noise = _noise_signals(run)["drive_position_m"]
    travel_m = float(np.median(np.abs(run.commands.drive)))  # travel in a second
    # a logged drive at rest has only rounding noise, below `RESOLVED_M`
    return _residual("drive", rig, run, values, noise, max(_DRIVE_SHARE * travel_m, RESOLVED_M))


def _exciter(run: Prepared) -> Residual | None:
    commands = run.commands
    on = kept_blocks(run) & (commands.frequency_Hz > 0.0)
    count = int(on.sum()) // _VIBRATION_BLOCKS * _VIBRATION_BLOCKS
    if "base_shake_mps2" not in run.signals or count == 0:
        return None
    at = np.flatnonzero(on)[:count]

    def mean(values: npt.NDArray[np.floating]) -> Floats:
        return values[at].reshape(-1, _VIBRATION_BLOCKS).mean(axis=1)

    commanded_mps2 = (2.0 * np.pi * commands.frequency_Hz) ** 2 * commands.amplitude_m
    still_mps2 = run.noise.shake_mps2.get("base_shake_mps2", 0.0)
    shaken_mps2 = np.sqrt(np.maximum(run.signals["base_shake_mps2"] ** 2 - still_mps2**2, 0.0)) * np.sqrt(2.0)
    seen = 1.0 / np.sqrt(1.0 + _ROLLED_OFF * (commands.frequency_Hz / 1e4) ** 2)
    share = mean(shaken_mps2) / mean(commanded_mps2 * seen)
    seen_badly = float(np.mean(0.5 * _ROLLED_OFF * (mean(commands.frequency_Hz) / 1e4) ** 2))
    over = {
        "time_s": mean((np.arange(len(on)) + 0.5) * BLOCK_S),
        "frequency_Hz": mean(commands.frequency_Hz),
    }
    if "drive_force_N" in run.signals:
        over["force_N"] = mean(run.signals["drive_force_N"])
    noise = float(np.mean(still_mps2 / mean(commanded_mps2)))
    spread = float(np.hypot(np.hypot(noise, _EXCITER_SHARE), seen_badly))
    return Residual("exciter", share - 1.0, spread, over)


def _friction(rig: RigTable, run: Prepared) -> Residual | None:
    has = run.signals.keys()
    if "drive_force_N" not in has or not {"mass_accel_mps2", "mass_position_m"} & has:
        return None

    # an accelerometer resolves the edges of a slip; a displacement that is differentiated twice needs smoothing
    smooth = 1.0 if "mass_accel_mps2" in has else smoothing_blocks(rig)

    def relation(signals: Signals) -> Floats:
        if "mass_accel_mps2" in signals:
            accel_mps2 = gaussian_filter1d(signals["mass_accel_mps2"], smooth)
        else:
            accel_mps2 = second_derivative(signals["mass_position_m"], smooth)
        return gaussian_filter1d(signals["drive_force_N"], smooth) - rig.mass_kg * accel_mps2

    over = motion(rig, run)
    if "velocity_mps" not in over:  # an axis with an accelerometer alone
        return None
    velocity_mps = over["velocity_mps"]
    values = relation(run.signals) - friction_law(rig, velocity_mps)
    # at rest the contact carries any force below the static friction; close to rest presliding sets the force
    sliding = np.abs(velocity_mps) > _SLIDES_FROM * rig.stribeck_velocity_mps
    inner = minimum_filter1d(sliding, 2 * math.ceil(_EDGE_MARGIN * max(smooth, 0.4 * smoothing_blocks(rig))) + 1)
    # under vibration the friction law does not hold
    used = kept_blocks(run) & (run.commands.frequency_Hz == 0.0) & inner
    noise = relation(_noise_signals(run))
    spread = float(np.sqrt(np.mean(noise**2) + (_ROUGH_SHARE * rig.coulomb_force_N) ** 2))
    over = {key: column[used] for key, column in over.items()}
    return Residual("friction", values[used], spread, over)


def friction_law(rig: RigTable, velocity_mps: Floats) -> Floats:
    """The friction force [N] of steady sliding at velocities of any sign, same shape; the manifest's law without a tail."""
    falling_N = (rig.static_force_N - rig.coulomb_force_N) * np.exp(-((velocity_mps / rig.stribeck_velocity_mps) ** 2))
    viscous_N = rig.viscous_damping_Ns_per_m * velocity_mps
    return np.sign(velocity_mps) * (rig.coulomb_force_N + falling_N) + viscous_N
