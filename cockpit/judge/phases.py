"""Stretches of a run: before the controller, hand-over, after, without a controller; whether they test the controller."""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.arrays import Floats
from bridge.log.in_charge import GONE_S, ChargeWatch
from cockpit.judge.machine_terms import BlockMotion, Following, FollowingSum
from cockpit.judge.setup import SETTLING_S, Setup
from cockpit.judge.slips import Forces, Swing
from cockpit.judge.watches import RigWatch, StepWatch
from diagnosis.slips import Cycles

Stretches = list[tuple[float, float]]

# First seconds of a phase, at most half of it, that do not count for swing and mean force: a run starts with an unloaded spring.
_RAMP_S = 4.0
# Longest motion of the drive after the last slip, in longest motions between two slips, with which slips go on. Larger: slips of
# a first start that ended are taken for stick-slip that the controller removed. Smaller: irregular stick-slip counts as ended.
_GOES_ON = 2.0
# Least share of the motion in which the slide must follow its drive. Smaller: a slide that never breaks away passes, as it
# catches up where the drive stops. Larger: short strokes on a soft spring are not judged.
_MUST_FOLLOW = 0.1


class Phase(NamedTuple):
    """One stretch of a run."""

    seconds: float
    slips: int
    slips_per_min: float
    # Drive force: mean fall in a slip, as `look` gives it, which block means would flatten. Without a slip: largest less smallest
    # block mean in the steady part of a stroke, median of strokes, as a vibration alone does not count.
    swing_N: float
    strokes: int  # number of these strokes; 0 without even motion: then a swing without a slip is over all blocks
    mean_force_N: float  # mean drive force of the stretch, without its first 4 s, or first half if that is shorter
    following: Following | None  # None without motion of the drive or without a measured position
    vibration_dose_mm2_per_s: float  # integral of v_a^2
    slips_went_on: bool  # slips up to the end of the stretch, not only e.g. at the first start of the drive


class PhaseSum:
    """A stretch of a run from `from_s` to `to_s`, summed window by window. Its end is infinite while unknown."""

    def __init__(self, from_s: float, to_s: float) -> None:
        self.from_s, self.to_s = from_s, to_s
        self.missing = 0  # blocks missing in the log, or without a finite force
        self.unsure = 0  # slips during which blocks are missing
        self.slips = 0
        self._blocks = 0
        self._between = self._last = 0  # blocks with a moving drive: most without a slip, and up to the last slip
        self._whole, self._steady = Swing(), Swing()
        self._falls_N: list[Floats] = []  # falls of the force in the slips that count for the swing
        self._following = FollowingSum()

    @property
    def moving(self) -> int:
        """Blocks in which the drive moved."""
        return self._following.moving

    def add(self, forces: Forces, motion: BlockMotion | None, without: Stretches, doubted: Stretches) -> None:
        """Add the part of a window inside the stretch and outside of the stretches `without`; no slips of `doubted` ones."""

        def counts(at_s: Floats) -> Any:
            return (at_s > self.from_s) & (at_s <= self.to_s) & ~within(at_s, without)

        inside = counts(forces.t_s)
        self._blocks += int(np.count_nonzero(inside))
        self.missing += int(forces.missing[inside].sum())
        breakaway_s = forces.cycles.breakaway_t_s
        slips = (breakaway_s >= self.from_s) & (breakaway_s < self.to_s) & ~within(breakaway_s, [*without, *doubted])
        self.slips += int(np.count_nonzero(slips))
        self.unsure += int(np.count_nonzero(slips & forces.unsure))
        if motion is not None and slips.any():
            moving_s = motion.t_s[counts(motion.t_s) & (motion.direction != 0)]
            at = self.moving + np.searchsorted(moving_s, breakaway_s[slips])
            self._between = max(self._between, int(np.diff(at, prepend=self._last).max()))
            self._last = int(at[-1])
        steady_s = min(self.from_s + _RAMP_S, 0.5 * (self.from_s + self.to_s))
        later = inside & (forces.t_s > steady_s)
        self._falls_N.append(_falls_N(forces.cycles, slips & (breakaway_s > steady_s)))
        self._steady.add(forces.mean_N[later], forces.part[later])
        if not self._steady.blocks:
            self._whole.add(forces.mean_N[inside], forces.part[inside])
        if motion is not None:
            self._following.add(motion, counts)

    def result(self, block_s: float) -> Phase | None:
        """Figures of the stretch; None if it has no block with a force."""
        if not self._blocks:
            return None
        seconds = self._blocks * block_s
        swing = self._steady if self._steady.blocks else self._whole
        falls_N = np.concatenate([*self._falls_N, np.empty(0)])
        swing_N, strokes = swing.result()
        swing_N = float(falls_N.mean()) if len(falls_N) else swing_N
        return Phase(
            seconds=seconds,
            slips=self.slips,
            slips_per_min=60.0 * self.slips / seconds,
            swing_N=swing_N,
            strokes=strokes,
            mean_force_N=swing.mean_N,
            following=self._following.result(block_s),
            vibration_dose_mm2_per_s=self._following.dose_mm2_per_s,
            slips_went_on=self.slips > 0 and self.moving - self._last <= _GOES_ON * self._between,
        )


def _falls_N(cycles: Cycles, slips: npt.NDArray[np.bool_]) -> Floats:
    """Fall of the force in each marked slip that ends before the next one begins."""
    begins_s = cycles.breakaway_t_s
    after = np.searchsorted(cycles.restick_t_s, begins_s)
    ends = after < len(cycles.restick_t_s)
    ended = slips & ends
    ended[:-1] &= (
        cycles.restick_t_s[np.minimum(after[:-1], len(cycles.restick_t_s) - 1)] < begins_s[1:] if ends.any() else False
    )
    return np.abs(cycles.breakaway_force_N[ended] - cycles.restick_force_N[after[ended]])


class Interruptions:
    """Stretches in which the controller was stopped, not armed, late or absent, in the part of the log read so far."""

    def __init__(self, setup: Setup, charge: ChargeWatch, steps: StepWatch) -> None:
        self._setup, self._charge, self._steps = setup, charge, steps

    def stops(self, is_last: bool) -> Stretches:
        """Stretches with the controller stopped or the rig not armed, each with its settling second."""
        return self._steps.stops(self._setup.block_s, is_last)

    def doubted(self, is_last: bool) -> Stretches:
        """Stretches in which the controller doubts the force or the slide position."""
        return self._steps.doubted(is_last)

    def fallbacks(self) -> Stretches:
        """Stretches in which the rig had no fresh command; the end is infinite while one lasts."""
        since_s = self._charge.open_from_s
        return [*self._charge.stretches, *([(since_s, np.inf)] if since_s is not None else [])]

    def gone(self) -> Stretches:
        """Fallbacks above 1 s, too long for a stall of the computer: the controller was absent."""
        return [stretch for stretch in self.fallbacks() if stretch[1] - stretch[0] > GONE_S]

    def stalls(self) -> Stretches:
        """Shorter fallbacks and late blocks after the settling of the controller, each with its settling second."""
        settled_s = self._setup.settled_from_s
        short = [
            (max(from_s, settled_s), until_s) for from_s, until_s in self.fallbacks() if until_s - from_s <= GONE_S
        ]
        return settling([*short, *(stretch for stretch in self._steps.stale if stretch[0] > settled_s)])

    def all(self, is_last: bool) -> Stretches:
        """Stretches excluded from the judgement of the controller, each with its settling second."""
        return [*self.stops(is_last), *settling([*self.fallbacks(), *self._steps.stale])]


def settling(stretches: Iterable[tuple[float, float]]) -> Stretches:
    """Stretches, each with the settling second after it."""
    return [(from_s, until_s + SETTLING_S) for from_s, until_s in stretches]


def within(at_s: Floats, stretches: Iterable[tuple[float, float]]) -> Any:
    """True for times inside any of the stretches."""
    inside = np.zeros(len(at_s), bool)
    if not len(at_s):
        return inside
    low_s, high_s = float(at_s.min()), float(at_s.max())
    for first_s, last_s in stretches:
        if first_s < high_s and last_s >= low_s:
            inside |= (at_s > first_s) & (at_s <= last_s)
    return inside


def apart(stretch: tuple[float, float], without: Stretches) -> Stretches:
    """Parts of `stretch` outside of the stretches `without`, which may overlap."""
    at_s, end_s = stretch
    parts: Stretches = []
    for from_s, until_s in sorted(without):
        if from_s > at_s:
            parts.append((at_s, min(from_s, end_s)))
        at_s = max(at_s, until_s)
    return [(first_s, last_s) for first_s, last_s in [*parts, (at_s, end_s)] if last_s > first_s]


def untested(
    setup: Setup,
    steps: StepWatch,
    seconds: float,
    unreadable: str,
    rig: RigWatch,
    after: Phase | None,
    in_charge_s: float,
) -> str:
    """Reason for which the run does not test the controller; empty if it does.

    Args:
        seconds: end of the last block; 0 without any.
        unreadable: error of the first unreadable block; empty without any.
        rig: the rig's answers and its fault at the end.
        in_charge_s: time in which the controller was in charge, including its settling.

    """
    if setup.imported:
        return "measured data of another program: no controller to judge"
    if not seconds:
        return (
            f"no block can be read: {unreadable}; every block must have all channels"
            if unreadable
            else "no block was recorded"
        )
    if not steps.steps:
        return "no step of a controller was recorded: nothing was tested"
    if not steps.armed:
        if rig.fault:
            return f"the rig was never armed, in FAULT by {rig.fault}: `stickslip reset` when it is safe, then `stickslip arm`"
        return "the rig was never armed: `stickslip arm`, or `arm = true` in the scenario of a simulated rig"
    if not steps.moved:
        return "the drive never moved: nothing was tested"
    if after is not None:
        return ""
    if seconds < setup.enabled_from_s:
        return f"ended before the controller was enabled (at {setup.enabled_from_s:.1f} s)"
    if in_charge_s <= 0.0 or not rig.answered:
        return "the controller was not in charge in this run"
    why = f"too short to judge: it has {SETTLING_S:g} s to settle"
    if in_charge_s > SETTLING_S:  # no finite force, or stops and stalls left no second to settle
        why = "but none of it can be judged"
    return f"the controller was in charge for {in_charge_s:.2g} s, {why}"


def too_little(after: Phase | None, phases: Mapping[str, PhaseSum], block_s: float) -> str:
    """Reason for which the controlled motion cannot show a slip: too short, or the slide rests; else empty."""
    if after is None:
        return ""
    moving_s, before = phases["after"].moving * block_s, phases["before"]
    if not moving_s:
        return f"the drive did not move in the {after.seconds:.2g} s with the controller in charge"
    if before.slips and moving_s < (period_s := before.moving * block_s / before.slips):
        line = f"the drive moved for {moving_s:.2g} s with the controller in charge"
        return f"{line}, less than the {period_s:.2g} s between two slips before: make the run longer"
    following, broke_away = after.following, before.slips + phases["taking_over"].slips > 0
    if following is not None and not broke_away and following.following_s < _MUST_FOLLOW * following.moving_s:
        line = f"the slide followed its drive for {following.following_s:.2g} of {following.moving_s:.2g} s"
        return f"{line} with the controller in charge: make the run longer, or correct the stiffness of the drive"
    return ""
