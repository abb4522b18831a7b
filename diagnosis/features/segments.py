"""What the rig was told: drive and vibration on the 1 ms grid, and the segments in which neither changes.

The drive is taken as even between changes of speed: an uneven drive is a gap, not an input. Where the manifest gives no
velocity, it is read from the drive position as pieces of constant velocity. Where a drive takes its time from one to the next,
it goes as it was measured.
"""

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.signal import savgol_filter

from diagnosis.evidence.folder import Run
from diagnosis.evidence.manifest import RigTable
from diagnosis.features.axis_motion import Motion, motion_of
from diagnosis.features.grid import BLOCK_S

Floats = npt.NDArray[np.floating[Any]]
_WINDOW = 100  # blocks: 0.1 s, over which a velocity is read from a position with noise
# A change of speed is one when it is larger than this share of the faster speed; a ripple of a screw stays below.
_SMALLEST_CHANGE = 0.35
SHORTEST_S = 0.3
_SHORTEST_WINDOWS = 3
_SLOWEST = 0.01  # of the fastest speed of the run: less is a stop, whose slope is the sensor's noise
_STILL_M = 1e-9  # and a drive that moves by less in all, or by less than its noise, stands: the rest is rounding
# What a window may be off the velocity of its piece, of the change that the piece begins or ends with
_ON_THE_WAY = 0.1
_QUICK = 2  # windows that are off for a change that is taken as a step: the settling covers half of it
_LONGEST_RAMP = 20  # windows
_RATE_WINDOW = 41  # blocks that a velocity is read from on the way: noise of 1 um is 13 um/s
# Blocks after a change of command, or the start of a run: 0.1 s, in which a drive or a piezo may still get there. A drive
# that took 50 ms to 0.17 mm/s left the force 0.05 N lower for all of a slow climb, 8 floors.
_SETTLING = 100


class Segment(NamedTuple):
    """Blocks [first, last) of constant drive and vibration."""

    first: int
    last: int
    drive_velocity_mps: float  # 0 with a force drive
    frequency_Hz: float
    amplitude_m: float
    slips: int = 0  # as measured: what is compared there must not depend on what a model does
    sticks: bool = False  # whole ones between two slips, as measured
    still: bool = False  # even sliding as measured

    @property
    def at_the_edge(self) -> bool:
        """Whether v_a is within a tenth of v_d, where stick-slip is about to end and every detail decides."""
        v_a = 2.0 * np.pi * self.frequency_Hz * self.amplitude_m
        return abs(v_a - abs(self.drive_velocity_mps)) < 0.1 * abs(self.drive_velocity_mps)

    @property
    def sign(self) -> float:
        """Direction of the drive."""
        return -1.0 if self.drive_velocity_mps < 0.0 else 1.0


class Commands(NamedTuple):
    """One value a block, and the segments in time order."""

    drive: Floats  # velocity [m/s], or force [N] with a force drive
    frequency_Hz: Floats
    amplitude_m: Floats
    segments: tuple[Segment, ...]
    motion: Motion | None = None  # of the slide, with a force drive
    changing_s: float = 0.0  # in which nothing stays the same for long enough to be a segment, in all


def commands_of(run: Run, rig: RigTable, reduced: dict[str, Floats]) -> Commands:
    """The commands of a run, from its columns and the velocity that the manifest states."""
    blocks = len(next(iter(reduced.values())))
    t_s = run.t_s[0] + (np.arange(blocks) + 0.5) * BLOCK_S
    frequency_Hz, amplitude_m = np.zeros(blocks), np.zeros(blocks)
    if "vibration_frequency_Hz" in run.columns and "vibration_amplitude_m" in run.columns:
        at = np.minimum(np.searchsorted(run.t_s, t_s), len(run.t_s) - 1)
        amplitude_m = run.columns["vibration_amplitude_m"][at]
        frequency_Hz = np.where(amplitude_m > 0.0, run.columns["vibration_frequency_Hz"][at], 0.0)
        amplitude_m = np.where(frequency_Hz > 0.0, amplitude_m, 0.0)
    if rig.drive == "force":
        drive = reduced["drive_force_N"]
        motion = motion_of(reduced, len(run.t_s) / blocks, rig)
        return Commands(drive, frequency_Hz, amplitude_m, (Segment(0, blocks, 0.0, 0.0, 0.0),), motion)
    if run.drive_velocity_mps is not None:
        drive = _stated(run.drive_velocity_mps, blocks, reduced.get("drive_position_m"))
    else:
        drive = _pieces(reduced["drive_position_m"])
    change = (np.diff(drive) != 0.0) | (np.diff(frequency_Hz) != 0.0) | (np.diff(amplitude_m) != 0.0)
    edges = [0, *(np.flatnonzero(change) + 1).tolist(), blocks]
    segments = tuple(
        Segment(
            first + _SETTLING,
            last,
            float(drive[first]),
            float(frequency_Hz[first]),
            float(amplitude_m[first]),
        )
        for first, last in pairwise(edges)
        if (last - first) * BLOCK_S >= SHORTEST_S
    )
    changing = sum(last - first for first, last in pairwise(edges) if (last - first) * BLOCK_S < SHORTEST_S)
    return Commands(drive, frequency_Hz, amplitude_m, segments, changing_s=changing * BLOCK_S)


def _stated(velocity_mps: float, blocks: int, position_m: Floats | None) -> Floats:
    """The stated velocity a block, but where the drive starts and stops as it was measured."""
    drive = np.full(blocks, velocity_mps)
    if position_m is not None:
        measured = _pieces(position_m)
        arrived = np.flatnonzero(np.abs(measured - velocity_mps) <= _ON_THE_WAY * abs(velocity_mps))
        if len(arrived):
            on_the_way = np.r_[: arrived[0], arrived[-1] + 1 : blocks]
            drive[on_the_way] = measured[on_the_way]
    return drive


def _pieces(position_m: Floats) -> Floats:
    """Velocity [m/s] a block: constant between changes of speed, and as measured where one takes its time."""
    blocks = len(position_m)
    if blocks < 4 * _WINDOW:
        return np.full(blocks, _slope(position_m))
    windows = blocks // _WINDOW
    means_m = position_m[: windows * _WINDOW].reshape(windows, _WINDOW).mean(axis=1)
    if float(np.ptp(means_m)) < max(float(np.diff(position_m).std()) / 2.0**0.5, _STILL_M):
        return np.zeros(blocks)
    velocity = np.array([_slope(position_m[i * _WINDOW : (i + 1) * _WINDOW]) for i in range(windows)])
    fastest = float(np.abs(velocity).max())
    edges = [0, *_changes(velocity, 0, windows, fastest), windows]
    pieces = [piece for piece in pairwise(edges) if not _is_ramp(velocity[slice(*piece)])] or [(0, windows)]
    speeds = [0.0, *(float(np.median(velocity[slice(*piece)])) for piece in pieces), 0.0]
    result = np.asarray(savgol_filter(position_m, _RATE_WINDOW, 2, deriv=1, delta=BLOCK_S))
    done, lines = 0, list[tuple[float, float]]()
    for number, (first, last) in enumerate(pieces):
        before, own, after = speeds[number : number + 3]
        # the outer windows of a piece may hold the change itself
        begin = first + max(_off(velocity[first:last], own, before, first == 0), int(first > 0))
        end = last - max(_off(velocity[first:last][::-1], own, after, last == windows), int(last < windows))
        inner = slice(begin * _WINDOW, end * _WINDOW if end < windows else blocks)
        slope, offset = np.polyfit(np.arange(blocks)[inner], position_m[inner], 1)
        if abs(slope) < _SLOWEST * fastest * BLOCK_S:
            slope, offset = 0.0, position_m[inner].mean()
        since = inner.start
        if lines and begin - done <= _QUICK:
            before_slope, before_offset = lines[-1]
            crossing = (offset - before_offset) / (before_slope - slope)
            since = round(float(np.clip(crossing, (first - 1) * _WINDOW, (first + 1) * _WINDOW)))
            result[done * _WINDOW : since] = before_slope / BLOCK_S
        result[since : inner.stop] = slope / BLOCK_S
        lines.append((float(slope), float(offset)))
        done = end
    return result


def _off(velocity: Floats, own: float, other: float, at_the_end: bool) -> int:
    """Windows from the first one on in which a piece is not at its velocity yet.

    At an end of the run, where nothing says what was before, a drive that starts or stops is below half of it.
    """
    if at_the_end and own * velocity[0] >= 0.5 * own * own:
        return 0
    on_the_way = np.abs(velocity - own) > _ON_THE_WAY * abs(own - other)
    most = len(velocity) - _SHORTEST_WINDOWS
    return min(int(np.argmin(on_the_way)), max(most, 0))


def _is_ramp(velocity: Floats) -> bool:
    """Whether a piece is a change of speed itself."""
    if len(velocity) > _LONGEST_RAMP:
        return False
    time = np.linspace(-0.5, 0.5, len(velocity))
    rise = float(time @ velocity) / float(time @ time)
    if abs(rise) < _SMALLEST_CHANGE * float(np.abs(velocity).max()):
        return False
    about = velocity - velocity.mean()
    return rise * rise * float(time @ time) > 0.8 * float(about @ about)


def _changes(velocity: Floats, first: int, last: int, fastest: float) -> list[int]:
    """Binary segmentation: windows at which the mean velocity changes for good."""
    shortest = _SHORTEST_WINDOWS
    if last - first < 2 * shortest:
        return []
    best, best_gain = 0, 0.0
    total = velocity[first:last]
    for cut in range(first + shortest, last - shortest + 1):
        left, right = velocity[first:cut], velocity[cut:last]
        gain = total.var() * len(total) - left.var() * len(left) - right.var() * len(right)
        if gain > best_gain:
            best, best_gain = cut, float(gain)
    if best == 0:
        return []
    left = float(np.median(velocity[first:best]))
    right = float(np.median(velocity[best:last]))
    # a window on the change itself spoils neither median; a stop counts against the fastest speed of the run
    if abs(left - right) < max(_SMALLEST_CHANGE * max(abs(left), abs(right)), _SLOWEST * fastest):
        return []
    return [*_changes(velocity, first, best, fastest), best, *_changes(velocity, best, last, fastest)]


def _slope(values: Floats) -> float:
    return float(np.polyfit(np.arange(len(values)), values, 1)[0]) / BLOCK_S
