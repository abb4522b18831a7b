"""Turning points of a record that differ by more than its noise, and the slips of a force record by a given rule.

All searches for slips begin here: of a log (`cockpit/judge`), of a record of unknown scale (`look`), of a segment (`features`).
"""

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.arrays import Bools, Floats, Indices
from bridge.log.watches.arrays import median, noise_of

# Smallest slip, in standard deviations of the noise. Too small: noise counts as slips; too large: small slips are lost.
# White noise spans 8 to 9 standard deviations over 10^5 samples.
NOISE_SPANS = 10.0
_PIECE = 32  # samples of a piece that is reduced to two samples if it turns at most once; 16 and 64 are slower
# Width over which samples are averaged first [s]. Too small: noise; too large: the peaks of a slip are cut.
# A slip of the paper's rig lasts pi sqrt(m / k_d) = 36 ms and its peaks are round: 1 ms cuts them by less than 3 mN and
# reduces noise of 20 mN rms at 20 kHz to 4.5 mN.
_BIN_S = 1e-3
# Smallest slip, as a share of the median force. At 3 kHz, close to elimination, the paper's pairs still swing by 12 % of it.
_SHARE = 0.03


def turns(values: Any, drop: float, at: Any) -> int:
    """Find maxima and minima that alternate and differ by at least `drop`; the first is a maximum.

    Args:
        values: the record, [samples]: a list, which plain Python reads faster, or an array where this function is compiled.
        drop: smallest difference, in the unit of the values.
        at: filled with the indices of the turning points, [samples].

    Returns their number.

    """
    count = 0
    sign = 1.0  # while the values rise
    extreme, extreme_at = -math.inf, 0
    for i in range(len(values)):
        value = sign * values[i]
        if value > extreme:
            extreme, extreme_at = value, i
        elif value < extreme - drop:
            at[count] = extreme_at
            count += 1
            sign = -sign
            extreme, extreme_at = -value, i
    return count


def turning_points(values: Floats, drop: float) -> Indices:
    """Indices of the turning points that `turns` finds.

    Takes a seventh of the time of uncompiled `turns` for 10 min at 10 kHz; the import of the compiler would take 0.3 s. A piece
    whose values differ by at most `drop` turns at most once, so its largest and its smallest value replace it.
    """
    pieces = values[: len(values) // _PIECE * _PIECE].reshape(-1, _PIECE)
    high, low = pieces.max(axis=1), pieces.min(axis=1)
    even = np.flatnonzero((low >= high - drop) & (high <= low + drop))
    kept = np.ones(len(values), np.bool_)
    of_pieces = kept[: pieces.size].reshape(pieces.shape)
    of_pieces[even] = False
    for extremes in (pieces[even].argmax(axis=1), pieces[even].argmin(axis=1)):
        of_pieces[even, extremes] = True
    places = np.flatnonzero(kept)
    at = [0] * len(places)
    count = turns(values[places].tolist(), drop, at)
    return places[at[:count]]


class Cycles(NamedTuple):
    """The slips of a record, in time order; arrays of [slips].

    The re-sticks are one fewer when the record ends inside a slip. A breakaway is the local maximum of the
    drive force before the fall, a re-stick the minimum at the end of the fall.
    """

    breakaway_t_s: Floats
    breakaway_force_N: Floats
    restick_t_s: Floats
    restick_force_N: Floats

    @property
    def slips(self) -> int:
        """Number of slips that began."""
        return len(self.breakaway_t_s)

    @property
    def force_max_N(self) -> float:
        """Mean force at breakaway, the paper's F_d max; nan without slips."""
        return float(self.breakaway_force_N.mean()) if self.slips else float("nan")

    @property
    def force_min_N(self) -> float:
        """Mean force at re-stick, the paper's F_d min; nan without a finished slip."""
        return float(self.restick_force_N.mean()) if len(self.restick_t_s) else float("nan")

    @property
    def swing_N(self) -> float:
        """Mean force at breakaway less that at re-stick; 0 without slips, nan if the only slip is cut off."""
        return self.force_max_N - self.force_min_N if self.slips else 0.0

    @property
    def period_s(self) -> float:
        """Mean time between breakaways; nan with fewer than two."""
        if self.slips < 2:
            return float("nan")
        return float(self.breakaway_t_s[-1] - self.breakaway_t_s[0]) / (self.slips - 1)

    @property
    def stick_s(self) -> float:
        """Mean time from a re-stick to the next breakaway; nan without a finished stick."""
        following = np.searchsorted(self.breakaway_t_s, self.restick_t_s)
        ended = following < self.slips
        if not ended.any():
            return float("nan")
        return float((self.breakaway_t_s[following[ended]] - self.restick_t_s[ended]).mean())

    def kept(self, slips: Bools, resticks: Bools | None = None) -> "Cycles":
        """The marked slips, with their re-sticks or with the re-sticks marked in `resticks`."""
        resticks = slips[: len(self.restick_t_s)] if resticks is None else resticks
        return Cycles(
            self.breakaway_t_s[slips],
            self.breakaway_force_N[slips],
            self.restick_t_s[resticks],
            self.restick_force_N[resticks],
        )

    def between(self, from_s: float, to_s: float) -> "Cycles":
        """The breakaways in [from_s, to_s), and the re-sticks in [from_s, to_s)."""
        return self.kept(*((at_s >= from_s) & (at_s < to_s) for at_s in (self.breakaway_t_s, self.restick_t_s)))


def joined(cycles: Iterable[Cycles]) -> Cycles:
    """The slips of several stretches of a record, concatenated."""
    columns = zip(Cycles(*[np.empty(0)] * 4), *cycles, strict=True)
    return Cycles(*(np.concatenate(parts) for parts in columns))


def find_cycles(
    t_s: npt.ArrayLike,
    drive_force_N: npt.ArrayLike,
    minimum_drop_N: float | None = None,
    slowest_fall_s: float = 0.1,
) -> Cycles:
    """Find the slips in a simulated or measured drive force.

    `t_s` is the time, increasing and nearly regular, 100 Hz or more; `drive_force_N` is the force in the drive
    spring, finite; both [samples].

    A slip is a big and fast fall from a local maximum to the next local minimum. Big: at least `minimum_drop_N`, by default
    `smallest_drop_N`. Fast: from 10 to 90 % of the fall within `slowest_fall_s`, by default 0.1 s, three times the 36 ms of a
    slip on the paper's spring; a softer drive needs more.

    Raises ValueError when the two differ in length.
    """
    if minimum_drop_N is None:
        minimum_drop_N = smallest_drop_N(t_s, drive_force_N)
    t_s, force_N = _binned(np.asarray(t_s, np.float64), np.asarray(drive_force_N, np.float64))
    at = turning_points(force_N, minimum_drop_N)
    tops, bottoms = at[::2], at[1::2]
    ends = [*bottoms, len(force_N) - 1]
    steep = [steep_part(force_N, top, end) for top, end in zip(tops, ends, strict=False)]
    fast = [t_s[last] - t_s[first] <= slowest_fall_s for first, last in steep]
    return Cycles(t_s[tops], force_N[tops], t_s[bottoms], force_N[bottoms]).kept(np.array(fast, np.bool_))


def smallest_drop_N(t_s: npt.ArrayLike, drive_force_N: npt.ArrayLike) -> float:
    """The larger of 3 % of the median magnitude of the force and ten times the noise of the record, both [samples].

    Noise of the means over 1 ms, in which slips are searched, or of neighbouring samples, whichever is smaller: slips of 80 N at
    193 Hz look like 27 N of noise in the means, and like 0.08 N in samples at 20 kHz.

    Raises ValueError when the two differ in length.
    """
    samples_N = np.asarray(drive_force_N, np.float64)
    force_N = _binned(np.asarray(t_s, np.float64), samples_N)[1]
    if len(force_N) < 3:
        return 0.0
    noise_N = min(float(noise_of(force_N)), float(noise_of(samples_N)))
    return max(_SHARE * median(np.abs(force_N)), NOISE_SPANS * noise_N)  # a drive may turn


def _binned(t_s: Floats, force_N: Floats) -> tuple[Floats, Floats]:
    """Means over bins of about 1 ms; a record sampled more slowly stays unchanged."""
    if t_s.shape != force_N.shape or t_s.ndim != 1:
        raise ValueError(f"t_s {t_s.shape}, drive_force_N {force_N.shape}: must be two rows of equal length")
    if len(t_s) < 2:
        return t_s, force_N
    width = max(1, round(_BIN_S * (len(t_s) - 1) / float(t_s[-1] - t_s[0])))
    kept = len(t_s) // width * width
    return t_s[:kept].reshape(-1, width).mean(axis=1), force_N[:kept].reshape(-1, width).mean(axis=1)


def steep_part(force_N: Floats, top: int, end: int) -> tuple[int, int]:
    """The last sample above 90 % and the first below 10 % of a fall that begins at `top` and ends at `end` or sooner."""
    fall_N = force_N[top : end + 1]
    fall_N = fall_N[: int(fall_N.argmin()) + 1]
    drop_N = float(fall_N[0] - fall_N[-1])
    above = np.flatnonzero(fall_N >= fall_N[0] - 0.1 * drop_N)
    below = np.flatnonzero(fall_N <= fall_N[0] - 0.9 * drop_N)
    return top + int(above[-1]), top + int(below[0])
