"""The exciter relation: logarithm of the delivered over the commanded vibration of the base."""

import math

import numpy as np

from diagnosis.features.grid import BLOCK_S, averaged, without_vibration
from diagnosis.gap.prepare import Prepared
from diagnosis.model.sensor_chain import ACCEL_GAIN, ORDINARY
from diagnosis.relations.relation import (
    RESOLUTION,
    SETTLES,
    Bools,
    Floats,
    Missing,
    Piece,
    Relation,
    Term,
    kept_blocks,
    term,
)
from diagnosis.relations.shapes import free

_ROW_BLOCKS = 20  # blocks of a row: 20 ms
_FEWEST_ROWS = 5  # stretches of vibration
_ROLLED_OFF = ORDINARY["accel_rolled_off"]
_UNEVEN = 0.003  # scatter of an ordinary accelerometer's gain from one frequency to another
_CORNERS_HZ = (1000.0, 1500.0, 2200.0, 3200.0, 4500.0, 6500.0, 9500.0)  # of a roll-off
_INSIDE_HZ, _BEYOND_HZ = np.linspace(1200.0, 4800.0, 19), (5200.0, 5800.0, 6500.0, 7500.0)


def exciter_relation(runs: list[Prepared]) -> Relation | Missing:
    """The relation without unit; `Missing` where no run vibrates with an accelerometer on the base."""
    if not any((run.commands.frequency_Hz > 0.0).any() for run in runs):
        return Missing("exciter", "no run vibrates")
    for run in runs:
        if "base_shake_mps2" not in run.signals and (run.commands.frequency_Hz > 0.0).any():
            return Missing("exciter", f"{run.file} has no base_accel_mps2 that is fast enough")
    pieces = tuple(pieces_of_vibration(run) for run in runs)
    if not any(pieces_of for pieces_of, run in zip(pieces, runs, strict=True) if not run.holdout):
        return Missing("exciter", "no vibration is held long enough")
    frequency = [row_means(run.commands.frequency_Hz) for run in runs]
    left = tuple(delivered_log(run) for run in runs)
    most_Hz = max(float(f.max()) for f in frequency)

    ones = [np.ones_like(f) for f in frequency]
    effects = [term("accelerometer-gain", "base", ones, 0.2, 0, "ratio")]
    for corner_Hz in _CORNERS_HZ:
        for order, law in ((1, _first_order), (2, _second_order)):
            shape = [law(f / corner_Hz) / abs(float(law(np.array([most_Hz / corner_Hz]))[0])) for f in frequency]
            form = f"order {order}, {corner_Hz:.3g} Hz"
            effects.append(term("piezo-roll-off", form, shape, 0.4, 1, "log_attenuation"))
    for frequency_Hz in (*_INSIDE_HZ, *_BEYOND_HZ):
        for share in (0.15, 0.7):
            shape = [_resonance(f / frequency_Hz, share) / share for f in frequency]
            effects.append(term("piezo-resonance", f"{frequency_Hz:.4g} Hz, {share:g}", shape, 0.5, 1, "share"))

    def sags(form: str, shape: list[Floats], sign: int = 0) -> None:
        effects.append(term("piezo-sag", form, shape, 0.3, sign, "log_loss"))

    forces = [row_means(run.signals["drive_force_N"]) for run in runs if "drive_force_N" in run.signals]
    patterns: list[Term] = []
    if len(forces) == len(runs):
        most_N = max(float(np.abs(f).max()) for f in forces)
        sags("load", [-f / most_N for f in forces])
        sags("load, steeper", [np.log1p(-0.45 * np.clip(f / most_N, -1.0, 1.0)) / 0.45 for f in forces], 1)
        patterns.append(free("the force", forces, 8))
    driven = [_driven_s(run) for run in runs]
    longest_s = max(len(run.commands.drive) for run in runs) * BLOCK_S
    for time_s in [longest_s * share for share in SETTLES]:
        warm = [np.expm1(-t / time_s) for t in driven]
        sags(f"heat {time_s:.2g} s", warm)
        sags(f"heat {time_s:.2g} s, strong", [-np.log1p(-0.6 * w) / 0.6 for w in warm])
    each_Hz = np.unique(np.concatenate(frequency))
    each_Hz = each_Hz[each_Hz > 0.0]
    levels = tuple(np.stack([f == level_Hz for level_Hz in each_Hz], axis=1).astype(np.float64) for f in frequency)
    patterns += [
        Term("the frequency", "", levels, math.nan),
        free("the time driven", driven, 8),
    ]
    return Relation(
        name="exciter", unit="", row_s=_ROW_BLOCKS * BLOCK_S, highest_Hz=25.0, left=left, pieces=pieces,
        nuisances=(
            term("gain", "", ones, ACCEL_GAIN),
            term("roll-off of the accelerometer", "", [-0.5 * (f / 1e4) ** 2 for f in frequency], _ROLLED_OFF[1]),
            term("its bend", "", [(f / 1e4) ** 4 for f in frequency], 0.25 * _ROLLED_OFF[1]),
            Term("each frequency", "", levels, _UNEVEN),
        ),
        effects=tuple(effects), patterns=tuple(patterns), resolution=RESOLUTION, keeps_mean=True,
    )  # fmt: skip


def row_means(values: Floats) -> Floats:
    """Means over the blocks of each row, [rows]."""
    count = len(values) // _ROW_BLOCKS
    return values[: count * _ROW_BLOCKS].reshape(count, _ROW_BLOCKS).mean(axis=1)


def delivered_log(run: Prepared) -> Floats:
    """Logarithm of the delivered over the commanded vibration, [rows]; 0 without a vibration."""
    if "base_shake_mps2" not in run.signals:
        return np.zeros(len(run.commands.drive) // _ROW_BLOCKS)
    still_mps2 = run.noise.shake_mps2.get("base_shake_mps2", 0.0)
    frequency_Hz = run.commands.frequency_Hz
    seen = 1.0 / (1.0 + _ROLLED_OFF[0] * (frequency_Hz / 1e4) ** 2)
    commanded = row_means(0.5 * ((2.0 * np.pi * frequency_Hz) ** 2 * run.commands.amplitude_m) ** 2 * seen)
    whole = without_vibration(run.signals, averaged(frequency_Hz))  # a block of 4.5 periods has another mean
    delivered = row_means(whole["base_shake_mps2"] ** 2) - still_mps2**2
    on = (commanded > 0.0) & (delivered > 0.0)
    result = np.zeros(len(commanded))
    result[on] = 0.5 * np.log(delivered[on] / commanded[on])
    return result


def pieces_of_vibration(run: Prepared) -> tuple[Piece, ...]:
    """Rows of one commanded vibration each, away from its changes."""
    kept = kept_blocks(run) & (run.commands.frequency_Hz > 0.0)
    count = len(kept) // _ROW_BLOCKS
    whole: Bools = np.asarray(kept[: count * _ROW_BLOCKS].reshape(count, _ROW_BLOCKS).min(axis=1))
    key = row_means(run.commands.frequency_Hz) + 1e9 * row_means(run.commands.amplitude_m)
    stretches: list[Piece] = []
    first = 0
    for row in range(1, count + 1):
        if row == count or whole[row] != whole[first] or key[row] != key[first]:
            if whole[first] and row - first >= _FEWEST_ROWS:
                stretches.append((first, row))
            first = row
    return tuple(stretches)


def _driven_s(run: Prepared) -> Floats:
    """Seconds driven since the run began, as at 3 kHz and the largest commanded amplitude, at each row."""
    commands = run.commands
    most_m = max(float(commands.amplitude_m.max()), 1e-12)
    power = (commands.amplitude_m / most_m) ** 2 * commands.frequency_Hz / 3000.0
    return row_means(np.cumsum(power) * BLOCK_S)


def _first_order(r: Floats) -> Floats:
    return -0.5 * np.log1p(r * r)


def _second_order(r: Floats) -> Floats:
    return -np.log(np.abs(1.0 - r * r + 1.8j * r))


def _resonance(r: Floats, share: float) -> Floats:
    return np.log(np.abs(1.0 + share * r * r / (1.0 - r * r + 0.08j * r)))
