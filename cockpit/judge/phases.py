"""The stretches of a run: before the controller, while it takes over, after, and without anybody in charge."""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from cockpit.judge.machine_terms import Following, FollowingSum, Motion
from cockpit.judge.slips import Forces
from cockpit.judge.strokes import Swing

Floats = npt.NDArray[np.floating[Any]]
Stretches = list[tuple[float, float]]

# The first ramp of a run starts from an unloaded spring, which is no swing of what follows: so much of a phase, or half.
_RAMP_S = 4.0


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


class PhaseSum:
    """A stretch of a run, gathered window by window. Its end is infinite while it is not known.

    Args:
        from_s, to_s: begin and end.

    """

    def __init__(self, from_s: float, to_s: float) -> None:
        self.from_s, self.to_s = from_s, to_s
        self.missing = 0  # blocks that are not in the log, or hold no force
        self.unsure = 0  # slips in which blocks are missing
        self.slips = 0
        self._blocks = 0
        self._whole, self._steady = Swing(), Swing()
        self._following = FollowingSum()

    @property
    def moving(self) -> int:
        """Blocks in which the drive moved."""
        return self._following.moving

    def add(self, forces: Forces, motion: Motion | None, without: Stretches) -> None:
        """The part of a window that is in the stretch, but for what lies in the stretches `without`."""

        def counts(at_s: Floats) -> Any:
            return (at_s > self.from_s) & (at_s <= self.to_s) & ~within(at_s, without)

        inside = counts(forces.t_s)
        self._blocks += int(np.count_nonzero(inside))
        self.missing += int(forces.missing[inside].sum())
        breakaway_s = forces.cycles.breakaway_t_s
        slips = (breakaway_s >= self.from_s) & (breakaway_s < self.to_s) & ~within(breakaway_s, without)
        self.slips += int(np.count_nonzero(slips))
        self.unsure += int(np.count_nonzero(slips & forces.unsure))
        later = inside & (forces.t_s > min(self.from_s + _RAMP_S, 0.5 * (self.from_s + self.to_s)))
        self._steady.add(forces.mean_N[later], forces.part[later])
        if not self._steady.blocks:
            self._whole.add(forces.mean_N[inside], forces.part[inside])
        if motion is not None:
            self._following.add(motion, counts)

    def result(self, block_s: float) -> Phase | None:
        """What happened; None without a block."""
        if not self._blocks:
            return None
        seconds = self._blocks * block_s
        swing = self._steady if self._steady.blocks else self._whole
        swing_N, strokes = swing.result()
        return Phase(
            seconds=seconds,
            slips=self.slips,
            slips_per_min=60.0 * self.slips / seconds,
            swing_N=swing_N,
            strokes=strokes,
            mean_force_N=swing.mean_N,
            following=self._following.result(block_s),
            vibration_dose_mm2_per_s=self._following.dose_mm2_per_s,
        )


def within(at_s: Floats, stretches: Iterable[tuple[float, float]]) -> Any:
    """Whether times lie in any of the stretches."""
    found = np.zeros(len(at_s), bool)
    if not len(at_s):
        return found
    low_s, high_s = float(at_s.min()), float(at_s.max())
    for first_s, last_s in stretches:
        if first_s < high_s and last_s >= low_s:
            found |= (at_s > first_s) & (at_s <= last_s)
    return found


def together(phases: Iterable[Phase | None]) -> Phase | None:
    """Several stretches as one; how the slide followed, in the longest. None without any."""
    there = [phase for phase in phases if phase is not None]
    if not there:
        return None
    seconds, slips = sum(phase.seconds for phase in there), sum(phase.slips for phase in there)
    widest = max(there, key=lambda phase: phase.swing_N)
    return Phase(
        seconds=seconds,
        slips=slips,
        slips_per_min=60.0 * slips / seconds,
        swing_N=widest.swing_N,
        strokes=widest.strokes,
        mean_force_N=sum(phase.mean_force_N * phase.seconds for phase in there) / seconds,
        following=max(there, key=lambda phase: phase.seconds).following,
        vibration_dose_mm2_per_s=sum(phase.vibration_dose_mm2_per_s for phase in there),
    )


def apart(whole: tuple[float, float], without: Stretches) -> Stretches:
    """The parts of a stretch that lie in none of others, which may overlap."""
    at_s, end_s = whole
    parts: Stretches = []
    for from_s, until_s in sorted(without):
        if from_s > at_s:
            parts.append((at_s, min(from_s, end_s)))
        at_s = max(at_s, until_s)
    return [(first_s, last_s) for first_s, last_s in [*parts, (at_s, end_s)] if last_s > first_s]
