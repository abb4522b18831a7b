"""The stretches of a run: before the controller, while it takes over, after, and without anybody in charge."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from cockpit.judge.machine_terms import Following, Motion
from cockpit.judge.strokes import swing_of
from diagnosis.features.cycles import Cycles

Floats = npt.NDArray[np.floating[Any]]
Stretches = list[tuple[float, float]]


class Phase(NamedTuple):
    """One stretch of a run."""

    seconds: float
    slips: int
    slips_per_min: float
    swing_N: (
        float  # of the drive force, largest to smallest block mean in the steady part of a stroke; median of strokes
    )
    strokes: (
        int  # of which that is the median; 0 where the drive moves evenly in none, and the swing is that of all blocks
    )
    mean_force_N: float
    following: Following | None  # None where no drive moved, or a position was not measured
    vibration_dose_mm2_per_s: float  # integral of v_a^2

    def as_dict(self) -> dict[str, Any]:
        """For `--json`."""
        return self._asdict() | {"following": self.following and self.following._asdict()}


class Told(NamedTuple):
    """What phases are made of; times, forces and parts are [blocks], those that are numbers alone."""

    cycles: Cycles | None
    t_s: Floats
    mean_N: Floats
    part: npt.NDArray[np.int64]  # the stroke in whose steady part a block is; -1 in none
    motion: Motion | None  # None for measured data of another program


def phase(told: Told, from_s: float, to_s: float, without: Stretches) -> Phase | None:
    """What happened from one time to another, but for what lies in the stretches `without`; None without a block or a force."""

    def kept(at_s: Floats) -> Any:
        return ~sum(((at_s > first_s) & (at_s <= last_s) for first_s, last_s in without), np.zeros(len(at_s), bool))

    def counts(at_s: Floats) -> Any:
        return (at_s > from_s) & (at_s <= to_s) & kept(at_s)

    inside = counts(told.t_s)
    if told.cycles is None or not inside.any():
        return None
    slips = int(np.count_nonzero(kept(told.cycles.between(from_s, to_s).breakaway_t_s)))
    seconds = to_s - from_s - sum(max(min(last_s, to_s) - max(first_s, from_s), 0.0) for first_s, last_s in without)
    # the first ramp of a run starts from an unloaded spring: no part of the swing of what follows
    later = inside & (told.t_s > min(from_s + 4.0, 0.5 * (from_s + to_s)))
    steady = later if later.any() else inside
    swing_N, strokes = swing_of(told.mean_N[steady], told.part[steady])
    return Phase(
        seconds=seconds,
        slips=slips,
        slips_per_min=60.0 * slips / seconds,
        swing_N=swing_N,
        strokes=strokes,
        mean_force_N=float(told.mean_N[steady].mean()),
        following=told.motion.following(counts) if told.motion is not None else None,
        vibration_dose_mm2_per_s=told.motion.dose_mm2_per_s(counts) if told.motion is not None else 0.0,
    )


def alone(told: Told, gone: Stretches) -> Phase | None:
    """What happened while nobody was in charge, in all such stretches; how the slide followed, in the longest."""
    phases = [phase(told, from_s, until_s, []) for from_s, until_s in gone]
    there = [one for one in phases if one is not None]
    if not there:
        return None
    seconds, slips = sum(one.seconds for one in there), sum(one.slips for one in there)
    mean_N = sum(one.mean_force_N * one.seconds for one in there) / seconds
    longest = max(there, key=lambda one: one.seconds)
    widest = max(there, key=lambda one: one.swing_N)
    return Phase(
        seconds=seconds,
        slips=slips,
        slips_per_min=60.0 * slips / seconds,
        swing_N=widest.swing_N,
        strokes=widest.strokes,
        mean_force_N=mean_N,
        following=longest.following,
        vibration_dose_mm2_per_s=sum(one.vibration_dose_mm2_per_s for one in there),
    )


def slips_in(cycles: Cycles | None, stretches: Stretches) -> int:
    """Slips in any of the stretches, each counted once."""
    if cycles is None or not stretches:
        return 0
    at_s = cycles.breakaway_t_s
    return int(np.count_nonzero(np.any([(at_s > one[0]) & (at_s <= one[1]) for one in stretches], axis=0)))
