"""Slips of a force record: breakaways, re-sticks, and their means over a run."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.arrays import Floats
from diagnosis.look.turns import turns

# Seconds over which samples are averaged first. Too small: noise; too large: the peaks of a slip are cut.
# A slip of the paper's rig lasts pi sqrt(m / k_d) = 36 ms and its peaks are round: 1 ms cuts them by less than 3 mN and
# reduces noise of 20 mN rms at 20 kHz to 4.5 mN.
_BIN_S = 1e-3
# Smallest slip, in standard deviations of the noise. Too small: noise counts as slips; too large: small slips are lost.
# White noise spans 8 to 9 standard deviations over the 20000 bins of a 20 s run.
_NOISE_SPANS = 10.0


class Cycles(NamedTuple):
    """The slips of a record, in time order; arrays of [slips].

    The re-sticks are one fewer when the record ends inside a slip. A breakaway is the local maximum of the
    drive force before the fall, a re-stick the minimum that ends it.
    """

    breakaway_t_s: Floats
    breakaway_force_N: Floats
    restick_t_s: Floats
    restick_force_N: Floats

    @property
    def slips(self) -> int:
        """How many slips began."""
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
        """Mean time from a re-stick to the next breakaway; nan without such a pair."""
        following = np.searchsorted(self.breakaway_t_s, self.restick_t_s)
        ended = following < self.slips
        if not ended.any():
            return float("nan")
        return float((self.breakaway_t_s[following[ended]] - self.restick_t_s[ended]).mean())

    def between(self, from_s: float, to_s: float) -> "Cycles":
        """The breakaways and the re-sticks that lie in [from_s, to_s), each judged by its own time."""
        slips = (self.breakaway_t_s >= from_s) & (self.breakaway_t_s < to_s)
        sticks = (self.restick_t_s >= from_s) & (self.restick_t_s < to_s)
        return Cycles(
            self.breakaway_t_s[slips],
            self.breakaway_force_N[slips],
            self.restick_t_s[sticks],
            self.restick_force_N[sticks],
        )


def find_cycles(
    t_s: npt.ArrayLike,
    drive_force_N: npt.ArrayLike,
    minimum_drop_N: float | None = None,
    slowest_fall_s: float = 0.1,
) -> Cycles:
    """Find the slips in a simulated or measured drive force.

    `t_s` is the time, increasing and nearly regular, 100 Hz or more; `drive_force_N` is the force in the drive
    spring, finite; both [samples].

    A slip is a big and fast fall from a local maximum to the next local minimum. Big: at least
    `minimum_drop_N`, by default the larger of 3 % of the median magnitude of the force and ten times the noise of the record.
    (At 3 kHz, close to elimination, the paper's pairs still swing by 12 % of their force.)
    Fast: from 10 to 90 % of the fall within `slowest_fall_s`, by default 0.1 s, three times the 36 ms of a
    slip on the paper's spring; a softer drive needs more.

    Raises ValueError when the two differ in length.
    """
    t_s, force_N = _binned(np.asarray(t_s, np.float64), np.asarray(drive_force_N, np.float64))
    if minimum_drop_N is None:
        minimum_drop_N = _smallest_drop_N(force_N)
    at = [0] * len(force_N)
    count = turns(force_N.tolist(), minimum_drop_N, at)
    peaks, troughs = at[:count:2], at[1:count:2]
    fast = [
        _fall_s(t_s[peak : trough + 1], force_N[peak : trough + 1]) <= slowest_fall_s
        for peak, trough in zip(peaks, [*troughs, len(force_N) - 1], strict=False)
    ]
    peaks = [peak for peak, is_fast in zip(peaks, fast, strict=True) if is_fast]
    troughs = [trough for trough, is_fast in zip(troughs, fast, strict=False) if is_fast]
    return Cycles(t_s[peaks], force_N[peaks], t_s[troughs], force_N[troughs])


def smallest_drop_N(t_s: npt.ArrayLike, drive_force_N: npt.ArrayLike) -> float:
    """The `minimum_drop_N` that `find_cycles` takes by default; t_s and drive_force_N are [samples].

    Raises ValueError when the two differ in length.
    """
    return _smallest_drop_N(_binned(np.asarray(t_s, np.float64), np.asarray(drive_force_N, np.float64))[1])


def _binned(t_s: Floats, force_N: Floats) -> tuple[Floats, Floats]:
    """Means over bins of about 1 ms; a record sampled more slowly stays unchanged."""
    if t_s.shape != force_N.shape or t_s.ndim != 1:
        raise ValueError(f"t_s {t_s.shape}, drive_force_N {force_N.shape}: must be two rows of equal length")
    if len(t_s) < 2:
        return t_s, force_N
    width = max(1, round(_BIN_S * (len(t_s) - 1) / float(t_s[-1] - t_s[0])))
    whole = len(t_s) // width * width
    return t_s[:whole].reshape(-1, width).mean(axis=1), force_N[:whole].reshape(-1, width).mean(axis=1)


def _smallest_drop_N(force_N: Floats) -> float:
    if len(force_N) < 3:
        return 0.0
    # second differences remove the climb of a stick, and their median ignores the few bins of the slips
    bend_N = np.abs(np.diff(force_N, 2))
    noise_N = 1.4826 * _median(bend_N) / 6.0**0.5
    return max(0.03 * _median(np.abs(force_N)), _NOISE_SPANS * noise_N)  # of either sign: a drive may turn


def _median(values: Floats) -> float:
    """As `numpy.median` of finite numbers, whose first call imports the masked arrays, which takes 30 ms."""
    middle = np.partition(values, ((len(values) - 1) // 2, len(values) // 2))
    return float(middle[(len(values) - 1) // 2] + middle[len(values) // 2]) / 2.0


def _fall_s(t_s: Floats, force_N: Floats) -> float:
    """Time from the last sample above 90 % of a fall to the first below 10 % of it."""
    top_N, drop_N = float(force_N[0]), float(force_N[0] - force_N.min())
    above = np.flatnonzero(force_N > top_N - 0.1 * drop_N)
    below = np.flatnonzero(force_N < top_N - 0.9 * drop_N)
    return float(t_s[below[0]] - t_s[above[-1]]) if len(above) and len(below) else 0.0
