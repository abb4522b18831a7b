"""Friction of a force-driven axis: the force less the inertia, in cells of time while the slide moves one way."""

import numpy as np
from scipy.signal import savgol_filter

from diagnosis.evidence.manifest import RigTable
from diagnosis.features.axis_motion import WINDOW
from diagnosis.features.grid import BLOCK_S
from diagnosis.gap.prepare import Prepared
from diagnosis.latent.rows import MOST_ROWS, SLIDING, STANDS, ExcessRows, Floats, noise_of_force_N
from diagnosis.relations.relation import pieces_of

_SLOW_STRIBECK = 2.0  # Stribeck velocities below which the friction turns
# Blocks of a row. At 20 the encoder's noise in the inertia takes 45 % of a measured axis, and direction 55 % (86 % at 50, 95 % at
# 100). At 100 a wrong mass is named as a matter of place on one of 37 development cases, and a gear's wave is shorter than a row.
_SHORTEST_CELL = 50
_BOTH_ENDS = WINDOW // 2 + 1  # blocks left out at the ends of a stretch


def axis_rows(rig: RigTable, runs: list[Prepared]) -> list[ExcessRows]:
    """Sliding friction of every run; a list of the rows of each stretch in one direction."""
    stretches = [(number, *piece) for number, run in enumerate(runs) for piece in _stretches(rig, run)]
    blocks = sum(last - first for _, first, last in stretches)
    cell = max(-(-blocks // MOST_ROWS), _SHORTEST_CELL)
    return [
        rows
        for number, *piece in stretches
        if (rows := _of_stretch(rig, runs[number], number, piece, cell)) is not None
    ]


def described_N(rig: RigTable, speed_mps: Floats) -> Floats:
    """The friction that the rig table describes, over the speed."""
    falling_N = (rig.static_force_N - rig.coulomb_force_N) * np.exp(-((speed_mps / rig.stribeck_velocity_mps) ** 2))
    return rig.coulomb_force_N + falling_N + rig.viscous_damping_Ns_per_m * speed_mps


def _stretches(rig: RigTable, run: Prepared) -> list[tuple[int, int]]:
    motion = run.commands.motion
    assert motion is not None, "a force drive has a motion"  # noqa: S101
    speed = np.abs(motion.velocity_mps)
    slowest = max(_SLOW_STRIBECK * rig.stribeck_velocity_mps, STANDS * float(speed.max()))
    slowest = min(slowest, 0.5 * float(speed.max()))
    moves = speed > slowest
    pieces: list[tuple[int, int]] = []
    for way in (-1.0, 1.0):
        pieces += pieces_of(moves & (np.sign(motion.velocity_mps) == way), 2 * _BOTH_ENDS + _SHORTEST_CELL)
    return sorted((first + _BOTH_ENDS, last - _BOTH_ENDS) for first, last in pieces)


def _of_stretch(rig: RigTable, run: Prepared, number: int, piece: list[int], cell: int) -> ExcessRows | None:
    motion = run.commands.motion
    assert motion is not None, "a force drive has a motion"  # noqa: S101
    force_N = run.signals["drive_force_N"]
    # in the window that smooths the motion, so force and inertia are filtered alike
    smooth_N = np.asarray(savgol_filter(force_N, WINDOW, 3))
    rate = np.asarray(savgol_filter(force_N, WINDOW, 3, deriv=1, delta=BLOCK_S))
    first, last = piece
    cells = max(round((last - first) / cell), 1)
    edges = np.linspace(first, last, cells + 1).astype(np.int64)
    counts = np.diff(edges)

    def means(values: Floats) -> Floats:
        return np.add.reduceat(values[first:last], edges[:-1] - first) / counts

    sign = float(np.sign(motion.velocity_mps[first]))
    load = run.beside.get("normal_load_N")
    return ExcessRows(
        signal=SLIDING,
        excess_N=sign * means(smooth_N - motion.inertia_N) - means(described_N(rig, np.abs(motion.velocity_mps))),
        sign=np.full(cells, sign),
        place_m=means(motion.position_m),
        t_s=run.before_s + means(np.arange(len(force_N)) * BLOCK_S),
        speed_mps=means(np.abs(motion.velocity_mps)),
        run=np.full(cells, number),
        held_out=np.full(cells, run.holdout),
        load_N=None if load is None else means(load),
        pull_N=sign * means(motion.inertia_N),
        rate_N_per_s=sign * means(rate),
        noise_N=noise_of_force_N(run) / float(np.mean(counts)) ** 0.5,
    )
