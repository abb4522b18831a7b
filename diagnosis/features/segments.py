"""The commands of a run: drive and vibration on the 1 ms grid, and the segments in which neither changes.

The drive counts as even between changes of speed: an uneven drive is a gap, not an input. Where the manifest gives no velocity,
the velocity is read from the drive position, as pieces of constant velocity. Where the drive takes time to change its speed, the
command follows the measured position.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.signal import savgol_filter

from bridge.arrays import Floats
from diagnosis.evidence.folder import MeasuredRun
from diagnosis.evidence.manifest import RigTable
from diagnosis.features.axis_motion import SlideMotion, motion_of
from diagnosis.features.grid import BLOCK_S

# Blocks (0.1 s) over which a velocity is read from a position. Too small: noise; too large: changes of speed are smeared.
_WINDOW = 100
# Smallest change of speed, as a share of the faster speed. Too small: the ripple of a screw splits segments.
# Too large: two speeds count as one.
_SMALLEST_CHANGE = 0.35
SHORTEST_S = 0.3  # shortest segment; shorter stretches of constant command are not compared
_SHORTEST_WINDOWS = 3  # fewest windows of a piece of constant velocity; with fewer a ripple counts as a change
# A drive counts as at rest below this share of the run's fastest speed, where its slope is the sensor's noise; and below this
# share of its position as travel in a whole run, which is rounding in 32 bits (or below its noise, if larger).
_SLOWEST, _STILL = 0.01, 1e-7
# Deviation of a window from the velocity of its piece, as a share of the change of speed, up to which the speed is reached.
# Too small: noise and ripple count as a change of speed. Too large: the end of a ramp counts as constant speed.
_ON_THE_WAY = 0.1
_QUICK = 2  # longest change of speed that counts as a step [windows]; `SETTLING` covers half of it
_LONGEST_RAMP = 20  # longest rise of speed that counts as a change [windows]; a longer rise is a piece with a gap
_RATE_WINDOW = 41  # blocks over which the velocity during a change is measured: 1 um of noise gives 13 um/s
# Blocks (0.1 s) left out after a change of command and at the start of a run, while drive and piezo settle.
# Too small: the settling shows as a gap; too large: short segments lose their slips. Counted: docs/method/diagnosis.md.
SETTLING = 100


class Segment(NamedTuple):
    """Blocks [first, last) of constant drive and vibration.

    The compared features of a segment follow from the measured slips, so they are the same for every model.
    """

    first: int
    last: int
    drive_velocity_mps: float  # 0 with a force drive
    frequency_Hz: float
    amplitude_m: float
    slips: int = 0  # number of measured slips
    sticks: bool = False  # whether a complete stick between two slips was measured
    still: bool = False  # whether even sliding was measured

    @property
    def at_the_edge(self) -> bool:
        """Whether v_a is within a tenth of v_d: there stick-slip is about to end, and any detail decides whether it does."""
        v_a = 2.0 * np.pi * self.frequency_Hz * self.amplitude_m
        return abs(v_a - abs(self.drive_velocity_mps)) < 0.1 * abs(self.drive_velocity_mps)

    @property
    def sign(self) -> float:
        """Direction of the drive, 1.0 or -1.0."""
        return -1.0 if self.drive_velocity_mps < 0.0 else 1.0


class CommandedRun(NamedTuple):
    """The commands of a run, [blocks] each, and its segments in time order."""

    drive: Floats  # velocity [m/s], or force [N] with a force drive
    frequency_Hz: Floats
    amplitude_m: Floats
    segments: tuple[Segment, ...]
    motion: SlideMotion | None = None  # measured motion of the slide, with a force drive only
    changing_s: float = 0.0  # total time of the stretches that are too short to be a segment


def commands_of(run: MeasuredRun, rig: RigTable, reduced: dict[str, Floats]) -> CommandedRun:
    """The commands of a run, from its columns and the velocity that the manifest states.

    Args:
        run: the measured run.
        rig: the described rig.
        reduced: signals of the run on the 1 ms grid, [blocks] each.

    """
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
        return CommandedRun(drive, frequency_Hz, amplitude_m, (Segment(0, blocks, 0.0, 0.0, 0.0),), motion)
    if run.drive_velocity_mps is not None:
        drive = _stated(run.drive_velocity_mps, blocks, reduced.get("drive_position_m"))
    else:
        drive = _pieces(reduced["drive_position_m"])
        if never_constant(reduced["drive_position_m"], drive):
            rate = np.asarray(savgol_filter(reduced["drive_position_m"], 2 * _WINDOW + 1, 2, deriv=1, delta=BLOCK_S))
            return CommandedRun(rate, frequency_Hz, amplitude_m, (), changing_s=blocks * BLOCK_S)
    change = (np.diff(drive) != 0.0) | (np.diff(frequency_Hz) != 0.0) | (np.diff(amplitude_m) != 0.0)
    edges = [0, *(np.flatnonzero(change) + 1).tolist(), blocks]
    f_Hz, u0_m = frequency_Hz, amplitude_m
    segments = tuple(
        Segment(first + SETTLING, last, float(drive[first]), float(f_Hz[first]), float(u0_m[first]))
        for first, last in pairwise(edges)
        if (last - first) * BLOCK_S >= SHORTEST_S
    )
    changing = sum(last - first for first, last in pairwise(edges) if (last - first) * BLOCK_S < SHORTEST_S)
    return CommandedRun(drive, frequency_Hz, amplitude_m, segments, changing_s=changing * BLOCK_S)


def never_constant(position_m: Floats, drive: Floats) -> bool:
    """Whether a drive changes its velocity all the time: a sine, a ramp, a control that hunts.

    For more than half of the time in which it moves, it is then in no piece of constant velocity, or in a piece whose velocity
    rises and falls in a single bow.

    Args:
        position_m: measured position, [blocks].
        drive: velocity as pieces of constant velocity, [blocks].

    """
    windows = len(position_m) // _WINDOW
    if windows < _SHORTEST_WINDOWS:
        return False
    measured = np.array([_slope(window) for window in position_m[: windows * _WINDOW].reshape(windows, _WINDOW)])
    commanded = drive[: windows * _WINDOW].reshape(windows, _WINDOW)
    moves = np.abs(measured) > _SLOWEST * float(np.abs(measured).max())
    constant = np.ptp(commanded, axis=1) == 0.0
    edges = np.flatnonzero(np.diff(commanded[:, 0]) != 0.0) + 1
    for first, last in pairwise([0, *edges.tolist(), windows]):
        if _is_bowed(measured[first:last]):
            constant[first:last] = False
    return float((moves & ~constant).sum()) > 0.5 * max(int(moves.sum()), 1)


def _is_bowed(velocity: Floats) -> bool:
    """Whether the velocity of a piece [windows] is one smooth bow, as high as a change of speed."""
    if len(velocity) < 2 * _SHORTEST_WINDOWS:
        return False
    time = np.linspace(-1.0, 1.0, len(velocity))
    bow = np.polyval(np.polyfit(time, velocity, 2), time)
    about = float(np.var(velocity))
    return float(np.ptp(bow)) > _SMALLEST_CHANGE * float(np.abs(velocity).max()) and float(np.var(bow)) > 0.8 * about


def _stated(velocity_mps: float, blocks: int, position_m: Floats | None) -> Floats:
    """The stated velocity [blocks]; the measured velocity while the drive starts and stops."""
    drive = np.full(blocks, velocity_mps)
    if position_m is not None:
        measured = _pieces(position_m)
        arrived = np.flatnonzero(np.abs(measured - velocity_mps) <= _ON_THE_WAY * abs(velocity_mps))
        if len(arrived):
            on_the_way = np.r_[: arrived[0], arrived[-1] + 1 : blocks]
            drive[on_the_way] = measured[on_the_way]
    return drive


def _pieces(position_m: Floats) -> Floats:
    """Velocity [m/s] of each block: constant between changes of speed, the measured velocity during a slow change."""
    blocks = len(position_m)
    if blocks < 4 * _WINDOW:
        return np.full(blocks, _slope(position_m))
    windows = blocks // _WINDOW
    means_m = position_m[: windows * _WINDOW].reshape(windows, _WINDOW).mean(axis=1)
    rounding_m = _STILL * float(np.abs(position_m).max())
    if float(np.ptp(means_m)) <= max(float(np.diff(position_m).std()) / 2.0**0.5, rounding_m):
        return np.zeros(blocks)
    velocity = np.array([_slope(position_m[i * _WINDOW : (i + 1) * _WINDOW]) for i in range(windows)])
    fastest = float(np.abs(velocity).max())
    edges = [0, *_changes(velocity, 0, windows, fastest), windows]
    pieces = [piece for piece in pairwise(edges) if not _is_ramp(velocity[slice(*piece)])] or [(0, windows)]
    speeds = [0.0, *(float(np.median(velocity[slice(*piece)])) for piece in pieces), 0.0]
    result = np.asarray(savgol_filter(position_m, _RATE_WINDOW, 2, deriv=1, delta=BLOCK_S))
    done, lines = 0, list[tuple[float, float]]()
    for number, (first, last) in enumerate(pieces):
        before, speed, after = speeds[number : number + 3]
        # the outer windows of a piece may hold the change of speed
        begin = first + max(_windows_under_way(velocity[first:last], speed, before, first == 0), int(first > 0))
        end = last - max(
            _windows_under_way(velocity[first:last][::-1], speed, after, last == windows), int(last < windows)
        )
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


def _windows_under_way(velocity: Floats, speed: float, neighbour: float, at_the_end: bool) -> int:
    """Number of windows from the first in which a piece has not reached its velocity `speed`; `neighbour`: the piece before.

    At an end of the run no neighbour is known; there a drive that starts or stops is below half of its velocity.
    """
    if at_the_end and speed * velocity[0] >= 0.5 * speed * speed:
        return 0
    on_the_way = np.abs(velocity - speed) > _ON_THE_WAY * abs(speed - neighbour)
    most = len(velocity) - _SHORTEST_WINDOWS
    return min(int(np.argmin(on_the_way)), max(most, 0))


def _is_ramp(velocity: Floats) -> bool:
    """Whether a piece is a single change of speed."""
    if len(velocity) > _LONGEST_RAMP:
        return False
    time = np.linspace(-0.5, 0.5, len(velocity))
    rise = float(time @ velocity) / float(time @ time)
    if abs(rise) < _SMALLEST_CHANGE * float(np.abs(velocity).max()):
        return False
    about = velocity - velocity.mean()
    return rise * rise * float(time @ time) > 0.8 * float(about @ about)


def _changes(velocity: Floats, first: int, last: int, fastest: float) -> list[int]:
    """Windows in [first, last) at which the mean velocity changes, by binary segmentation."""
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
    # medians, as a window that holds the change must not count; a stop is compared with the fastest speed of the run
    if abs(left - right) < max(_SMALLEST_CHANGE * max(abs(left), abs(right)), _SLOWEST * fastest):
        return []
    return [*_changes(velocity, first, best, fastest), best, *_changes(velocity, best, last, fastest)]


def _slope(values: Floats) -> float:
    return float(np.polyfit(np.arange(len(values)), values, 1)[0]) / BLOCK_S
