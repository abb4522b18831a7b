"""Friction of a slide on a spring: at each breakaway, in the middle of each slip, and while it slides evenly.

The force of an undamped slide falls as far below the sliding friction as it exceeded it at breakaway. So the mean of peak and
trough is the sliding friction in a slip; no acceleration is needed, and no constant speed of the drive.
"""

import numpy as np

from bridge.arrays import Indices
from diagnosis.evidence.manifest import RigTable
from diagnosis.features.feature import Signals, scales_of
from diagnosis.features.grid import BLOCK_S
from diagnosis.features.segments import SETTLING
from diagnosis.features.slips import find_slips
from diagnosis.gap.prepare import Prepared
from diagnosis.latent.rows import BREAKAWAY, SLIDING, STANDS, ExcessRows, Floats, noise_of_force_N
from diagnosis.relations.relation import pieces_of

_CELL = 200  # blocks of a row of even sliding
_OVER_NOISE = 4.0  # standard deviations of the noise by which the force falls in a slip; a smaller fall may be noise


def spring_rows(rig: RigTable, runs: list[Prepared]) -> list[ExcessRows]:
    """Breakaways and sliding friction of every run that has a force; a list of the rows of each run and signal."""
    result: list[ExcessRows] = []
    gone_m = 0.0  # without a measured path, runs follow one another: no place of a run is known to be in another run
    for number, run in enumerate(runs):
        force_N = run.signals.get("drive_force_N")
        if force_N is None:
            continue
        drive_mps = run.commands.drive
        drive_mps = np.where(np.abs(drive_mps) > STANDS * np.abs(drive_mps).max(), drive_mps, 0.0)
        place_m = gone_m + _place_m(rig, run.signals, drive_mps, force_N)
        if not {"mass_position_m", "drive_position_m"} & run.signals.keys():
            gone_m += float(np.abs(drive_mps).sum()) * BLOCK_S
        for first, last in _stretches(run, drive_mps):
            result += _of_stretch(rig, run, number, slice(first, last), drive_mps, place_m)
    return result


def _stretches(run: Prepared, drive_mps: Floats) -> list[tuple[int, int]]:
    """Blocks [first, last) of one direction without vibration."""
    sign = np.sign(drive_mps)
    still = run.commands.frequency_Hz == 0.0
    pieces: list[tuple[int, int]] = []
    for way in (-1.0, 1.0):
        pieces += pieces_of((sign == way) & still)
    return sorted(pieces)


def _place_m(rig: RigTable, signals: Signals, drive_mps: Floats, force_N: Floats) -> Floats:
    """Place of the slide: measured, or position of the drive less the extension of the spring, [blocks]."""
    if "mass_position_m" in signals:
        return signals["mass_position_m"]
    drive_m = signals.get("drive_position_m")
    if drive_m is None:
        drive_m = np.cumsum(drive_mps) * BLOCK_S
    return drive_m - force_N / scales_of(rig).stiffness_N_per_m


def _of_stretch(
    rig: RigTable, run: Prepared, number: int, stretch: slice, drive_mps: Floats, place_m: Floats
) -> list[ExcessRows]:
    sign = float(np.sign(drive_mps[stretch.start]))
    speed_mps = np.abs(drive_mps[stretch])
    scales = scales_of(rig)
    noise_N = noise_of_force_N(run)
    scales = scales._replace(drop_N=max(scales.drop_N, _OVER_NOISE * noise_N))
    cut = {name: sign * values[stretch] for name, values in run.signals.items() if name == "drive_force_N"}
    slips = find_slips(cut, scales)
    level_N = cut["drive_force_N"] + sign * run.beside.get("other_force_N", np.zeros(len(drive_mps)))[stretch]
    if len(slips.tops) >= 2:
        tops, bottoms = slips.tops[1:], slips.bottoms[1:]
        middle_N = 0.5 * (level_N[tops] + level_N[bottoms]) - rig.coulomb_force_N
        fall_mps = (level_N[tops] - level_N[bottoms]) / scales.stiffness_N_per_m / (2.0 * scales.slip_s / np.pi)
        breaks_N, middle = level_N[tops] - rig.static_force_N, (tops + bottoms) // 2
        return [
            _rows(BREAKAWAY, run, number, stretch, sign, tops, breaks_N, place_m, speed_mps[tops], noise_N),
            _rows(SLIDING, run, number, stretch, sign, middle, middle_N, place_m, fall_mps, noise_N),
        ]
    if len(slips.tops):
        return []
    inner = np.arange(SETTLING, stretch.stop - stretch.start - SETTLING)
    cells = len(inner) // _CELL
    if cells == 0:
        return []
    at = inner[: cells * _CELL].reshape(cells, _CELL)
    mean_N = level_N[at].mean(axis=1) - rig.coulomb_force_N
    speed = speed_mps[at].mean(axis=1)
    return [_rows(SLIDING, run, number, stretch, sign, at[:, _CELL // 2], mean_N, place_m, speed, noise_N / _CELL**0.5)]


def _rows(
    signal: str, run: Prepared, number: int, stretch: slice, sign: float, at: Indices, excess_N: Floats,
    place_m: Floats, speed_mps: Floats, noise_N: float,
) -> ExcessRows:  # fmt: skip
    count, index = len(at), at + stretch.start
    load = run.beside.get("normal_load_N")
    return ExcessRows(
        signal=signal,
        excess_N=excess_N,
        sign=np.full(count, sign),
        place_m=place_m[index],
        t_s=run.before_s + index * BLOCK_S,
        speed_mps=speed_mps,
        run=np.full(count, number),
        held_out=np.full(count, run.holdout),
        load_N=None if load is None else load[index],
        pull_N=None,
        rate_N_per_s=None,
        noise_N=noise_N,
    )
