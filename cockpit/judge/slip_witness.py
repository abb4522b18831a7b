"""Slips by two witnesses besides the drive force: the slide's place against the drive's, and the controller's own count.

By the places a slip is a fall of drive less slide along the motion in which the slide is faster than 1.4 v_d: the peak
of that sine is the 1.5 v_d of docs/method/bank.md. So the rule is that of the force (`cockpit.judge.slips`) without the force.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from bridge.wire.messages import Records
from cockpit.judge.described import Described

Floats = npt.NDArray[np.float64]

_BESIDE_S = 0.05  # before and after, over which the drive's velocity is taken; the largest counts
_AHEAD = 0.4  # of v_d by which the slide is faster
_SIGMAS = 10.0  # of the places' noise in a fall, as of the force's
_LEAST_SHARE = 0.03  # of F_c / k_d in a fall, as of the force; smaller ones are friction that changes along the track
_TURNS = 0.02  # of v_d, from which two velocities of opposite sign are a turn
_STOPS = 0.5  # of the drive's velocity before
_APART_BINS = 3  # of rest between two slips: a fall that a sample interrupts is one
_MOST = 100_000  # times of slips that are kept, 0.8 MB; of more, only their number


def behind_noise_m(of: Described, samples_per_bin: int) -> float:
    """Standard deviation of drive less slide in a bin, as described; 0 where it is not.

    Steps that are coarser than the noise are not averaged: all samples of a bin are off by the same.
    """
    noise_m, step_m = of.noise["mass_position_m"], of.step["mass_position_m"]
    averaged = samples_per_bin if noise_m > 0.5 * step_m else 1
    return float(
        np.nan_to_num(
            math.sqrt(2.0) * math.hypot(noise_m / math.sqrt(samples_per_bin), step_m / math.sqrt(12.0 * averaged))
        )
    )


def noise_of(values: Floats) -> float:
    """Standard deviation of white noise on what moves smoothly most of the time, from every fourth second difference."""
    bend = np.abs(values[2::4] - 2.0 * values[1:-1:4] + values[:-2:4])
    return float(np.median(bend)) / 0.6745 / math.sqrt(6.0)


class Times:
    """Times of events: the first ones, and how many there were."""

    def __init__(self) -> None:
        self._parts: list[Floats] = []
        self._kept = 0
        self.count = 0

    def add(self, at_s: Floats) -> None:
        """Take more, later ones."""
        self.count += len(at_s)
        if self._kept < _MOST and len(at_s):
            self._parts.append(at_s[: _MOST - self._kept])
            self._kept += len(self._parts[-1])

    def all(self) -> Floats:
        """The first 100 000."""
        return np.concatenate([np.empty(0), *self._parts])


class PlaceSlips:
    """Slips by the places of slide and drive, in means of about 1 ms; the memory does not grow."""

    def __init__(self, of: Described, bin_s: float, samples_per_bin: int) -> None:
        self.times = Times()
        self._bin_s = bin_s
        self._beside = max(round(_BESIDE_S / bin_s), 1)
        longest = max(math.ceil(of.slowest_fall_s / bin_s), 1)
        self._lags = [2**n for n in range(longest.bit_length())]
        # of drive less slide, in a bin; what is not described is measured
        self._sigma_m = behind_noise_m(of, samples_per_bin)
        self._quietest_m = math.inf
        least_m = _LEAST_SHARE * of.sliding_N / of.stiffness_N_per_m if of.of_rig else 0.0
        self._least_m = float(np.nan_to_num(least_m))
        self._slip_m = of.slip_m
        self._kept: list[Floats] = [np.empty(0)] * 4
        self._since = _APART_BINS + 1  # bins since the last one of a fall

    @property
    def fall_m(self) -> float:
        """The smallest fall that counts."""
        quietest_m = self._quietest_m if math.isfinite(self._quietest_m) else 0.0
        return max(_SIGMAS * max(self._sigma_m, quietest_m), self._least_m)

    @property
    def sees(self) -> bool:
        """Whether a slip of the description would count; False where it is not described."""
        return self.fall_m < self._slip_m

    def add(self, t_s: Floats, drive_m: Floats, slide_m: Floats, part: Floats) -> None:
        """Take bins, [bins] each; `part` is another number after every gap."""
        t_s, drive_m, slide_m, part = self._kept = [
            np.concatenate(both) for both in zip(self._kept, (t_s, drive_m, slide_m, part), strict=True)
        ]
        beside, back = self._beside, max(2 * self._beside, self._lags[-1])
        first, end = back, len(t_s) - 2 * beside
        if end <= first:
            return
        behind_m = drive_m - slide_m
        self._quietest_m = min(self._quietest_m, noise_of(behind_m))
        mean_mps = (drive_m[2 * beside :] - drive_m[: -2 * beside]) / (2.0 * beside * self._bin_s)
        before, now, later = (
            mean_mps[at - beside : at - beside + end - first] for at in (first - beside, first, first + beside)
        )
        speed_mps = np.maximum(np.maximum(np.abs(before), np.abs(now)), np.abs(later))
        turns = (before * later < 0.0) & (np.minimum(np.abs(before), np.abs(later)) > _TURNS * speed_mps)
        stops = np.abs(later) < _STOPS * np.abs(before)  # the slide comes after its drive, which is no slip
        way = np.sign(before + now + later)
        least_m, falls = self.fall_m, np.zeros(end - first, bool)
        for lag in self._lags:
            fell_m = way * (behind_m[first - lag : end - lag] - behind_m[first:end])
            reach = max(lag, 2 * beside)
            whole = part[first - reach : end - reach] == part[first + 2 * beside : end + 2 * beside]
            falls |= whole & (fell_m > np.maximum(_AHEAD * lag * self._bin_s * speed_mps, least_m))
        self._count(t_s[first:end], falls & ~turns & ~stops)
        self._kept = [one[end - back :] for one in self._kept]

    def _count(self, t_s: Floats, falls: npt.NDArray[np.bool_]) -> None:
        at = np.flatnonzero(falls)
        if not len(at):
            self._since += len(falls)
            return
        since = np.diff(at, prepend=-self._since)
        self.times.add(t_s[at[since > _APART_BINS]])
        self._since = len(falls) - int(at[-1])


class TraceSlips:
    """Slips and surges that the controller counted."""

    def __init__(self) -> None:
        self.slips, self.surges = Times(), Times()
        self._last: dict[str, int | None] = {"slips": None, "surges": None}

    def add(self, trace: Records) -> None:
        """Take steps of the controller, [steps]."""
        if not len(trace):
            return
        for name, times in (("slips", self.slips), ("surges", self.surges)):
            counts = trace[name].astype(np.int64)
            last = self._last[name]
            more = np.diff(counts, prepend=counts[0] if last is None else last)
            at = np.flatnonzero(more > 0)  # a controller that began again counts from 0
            times.add(np.repeat(trace["t_ns"][at] * 1e-9, np.minimum(more[at], 1000)))
            self._last[name] = int(counts[-1])


def within(at_s: npt.NDArray[np.floating[Any]], stretches: Any) -> int:
    """How many of the times lie in any of the stretches, from and until [s]."""
    return int(sum(np.count_nonzero((at_s > from_s) & (at_s <= until_s)) for from_s, until_s in stretches))
