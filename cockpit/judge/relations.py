"""What the sensors of an axis must have to do with each other: force and spring, the base's acceleration and the command.

A channel that is swapped with another one, of the wrong sign or scale, or not connected breaks a relation of physics that the
other channels keep. A relation says nothing where nothing moves enough to stand out from noise.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from cockpit.judge.described import Described

Floats = npt.NDArray[np.float64]

_WINDOW_S = 0.25  # in which force and spring are compared about their means: drift and zeros of the sensors fall out
_EPOCH_S = 1.0  # of which each has a result of its own: a channel that fails later is seen
# Variance of the spring's extension over that of its noise, from which a window counts: noise makes k_d at most 4 % too small.
_EXCITED = 25.0
_SIGMAS = 5.0  # of the slope by which it is outside
# rms of the slide over that of the base under vibration, and the share of the blocks in which it is more. Smaller: slips under a
# vibration that is too weak, 5 % of the blocks in the bank, count; larger: a swap in the last fifth of a run passes.
_LOUDER, _LOUDER_SHARE = 1.3, 0.2
_SEEN = 3.0  # noise of the accelerometer, from which the base shows a vibration
_WELL_ABOVE = 100.0  # the same, of what is commanded, below which no statement is made
_AT_REST = 10.0  # the same, of blocks at rest that count as loud
_SAME_FORCE = 0.02  # of the force, up to which log and controller have the same; it is equal to the last bit
_SAME_V_A = 2.2  # factor of v_a, either way; in the bank 0.97 to 1.1, as the accelerometer's roll-off is corrected for
_OTHER_SHARE = 0.01  # of the blocks, from which the log has another force
_FEWEST = 200  # blocks with vibration of which v_a is compared
_RARE = 1e-3  # of the blocks at rest, up to which loud ones are chance


class Doubt(NamedTuple):
    """A relation that does not hold."""

    code: str
    text: str
    decides: bool


class SpringRelation:
    """F = k_d (drive - slide), window by window; the memory does not grow."""

    def __init__(self, of: Described, bin_s: float, noise_m: float) -> None:
        self._of = of
        self._least_m2 = max(noise_m, 1e-12) ** 2
        self._width = max(round(_WINDOW_S / bin_s), 8)
        self._windows = max(round(_EPOCH_S / bin_s / self._width), 1)
        self._rest: list[Floats] = [np.empty(0)] * 3
        self.epochs = 0
        self._wrong: dict[str, list[tuple[float, float, float]]] = {}  # kind: first time, ratio, and how many

    def add(self, t_s: Floats, force_N: Floats, behind_m: Floats) -> None:
        """Take bins, [bins] each; behind_m is drive less slide."""
        t_s, force_N, behind_m = (
            np.concatenate(both) for both in zip(self._rest, (t_s, force_N, behind_m), strict=True)
        )
        size = self._width * self._windows
        epochs = len(t_s) // size
        self._rest = [one[epochs * size :] for one in (t_s, force_N, behind_m)]
        if not epochs:
            return
        force_N, behind_m = (
            one[: epochs * size].reshape(epochs, self._windows, self._width) for one in (force_N, behind_m)
        )
        bend_m = np.abs(behind_m[..., 2::4] - 2.0 * behind_m[..., 1:-1:4] + behind_m[..., :-2:4])
        noise_m2 = (np.median(bend_m, axis=(1, 2)) / 0.6745) ** 2 / 6.0
        behind_m = behind_m - behind_m.mean(axis=2, keepdims=True)
        force_N = force_N - force_N.mean(axis=2, keepdims=True)
        square_m2 = (behind_m**2).mean(axis=2)
        excited = square_m2 > _EXCITED * np.maximum(noise_m2[:, None], self._least_m2)
        ee, ff, fe = (
            (excited * (a * b).sum(axis=2)).sum(axis=1)
            for a, b in ((behind_m, behind_m), (force_N, force_N), (force_N, behind_m))
        )
        count = excited.sum(axis=1) * self._width
        for at in np.flatnonzero(count):
            slope = float(fe[at] / ee[at])
            left_N2 = max(float(ff[at] - fe[at] ** 2 / ee[at]), 0.0)
            sigma = math.sqrt(left_N2 / float(count[at]) / float(ee[at]))
            explained = 1.0 - left_N2 / max(float(ff[at]), 1e-30)
            self._judge(float(t_s[at * size]), slope, sigma, explained)

    def _judge(self, from_s: float, slope: float, sigma: float, explained: float) -> None:
        of, self.epochs = self._of, self.epochs + 1
        ratio = slope / of.stiffness_N_per_m
        spread = sigma / of.stiffness_N_per_m
        kind = ""
        if not math.isfinite(ratio):
            return
        if ratio + _SIGMAS * spread < 0.0 and explained > 0.25:
            kind = "sign"
        elif ratio + _SIGMAS * spread < 1.0 / of.off:
            kind = "small"
        elif ratio - _SIGMAS * spread > of.off:
            kind = "large"
        if kind:
            found = self._wrong.setdefault(kind, [(from_s, 0.0, 0.0)])
            first_s, total, times = found[0]
            found[0] = (first_s, total + ratio, times + 1.0)

    def doubts(self) -> list[Doubt]:
        """What does not hold."""
        found: list[Doubt] = []
        for kind, ((from_s, total, times),) in self._wrong.items():
            ratio, k_d = total / times, self._of.stiffness_N_per_m
            what = (
                f"the drive force changes by {ratio * k_d:.3g} N per m of drive less slide, the spring has {k_d:.3g} N/m "
                f"(in {times:.0f} of {self.epochs} s with motion, first at {from_s:.1f} s)"
            )
            if kind == "sign":
                text = f"{what}: the force has the wrong sign, or both positions are swapped"
                found.append(Doubt("SENSOR_SWAPPED", text, True))
            else:
                text = f"{what}: the force or a position is of another scale, another signal, or not connected"
                found.append(Doubt("SENSOR_SCALE", text, True))
        return found


class ShakenRelation:
    """The base shakes as it is commanded, more than the slide, and is silent otherwise; [blocks]."""

    def __init__(self, of: Described) -> None:
        self._of = of
        self.shaken = 0  # blocks
        self._seen = self._faint = self._louder = 0
        self._rest = self._loud = 0

    def add(
        self, base_mps2: Floats, slide_mps2: Floats, commanded_mps2: Floats, rests: npt.NDArray[np.bool_]
    ) -> npt.NDArray[np.bool_]:
        """Take blocks; returns in which of them a vibration stands well out of the noise.

        Args:
            base_mps2, slide_mps2: rms about the mean of each block.
            commanded_mps2: rms of what the amplitude in force would give, 0 where it changed or rests.
            rests: blocks since whose vibration 0.1 s have passed.

        """
        noise = float(np.nan_to_num(self._of.noise["base_accel_mps2"]))
        shaken = commanded_mps2 > max(_WELL_ABOVE * noise, 0.0)
        self.shaken += int(np.count_nonzero(shaken))
        self._faint += int(np.count_nonzero(shaken & (base_mps2 < _SEEN * noise)))
        self._louder += int(np.count_nonzero(shaken & (slide_mps2 > _LOUDER * base_mps2)))
        self._rest += int(np.count_nonzero(rests))
        loud = rests & (base_mps2 > _AT_REST * max(noise, 1e-12)) & (base_mps2 > _LOUDER * slide_mps2)
        self._loud += int(np.count_nonzero(loud)) if noise > 0.0 else 0
        return shaken

    def doubts(self) -> list[Doubt]:
        """What does not hold."""
        found: list[Doubt] = []
        if self.shaken and self._faint > 0.5 * self.shaken:
            text = (
                f"the base accelerometer shows noise alone in {self._faint} of {self.shaken} blocks with vibration: it is not "
                "connected, or the exciter is off"
            )
            found.append(Doubt("SENSOR_ABSENT", text, True))
        elif self.shaken and self._louder > _LOUDER_SHARE * self.shaken:
            text = (
                f"the slide shakes more than the base in {self._louder} of {self.shaken} blocks with vibration: both "
                "accelerometers are swapped, or the base's is another signal"
            )
            found.append(Doubt("SENSOR_SWAPPED", text, True))
        if self._loud > max(_RARE * self._rest, 3.0) and not self._of.base_yields:
            text = (
                f"the base accelerometer shows motion in {self._loud} of {self._rest} blocks without vibration, more than the "
                "slide's: both are swapped, or it is another signal"
            )
            found.append(Doubt("SENSOR_SWAPPED", text, True))
        return found


class SameRelation:
    """The log holds the force and the base's vibration with which the controller worked; [blocks]."""

    def __init__(self, of: Described) -> None:
        self._of = of
        self._blocks = self._other = self._looks = self._other_looks = 0
        self._ratio = 1.0

    def add(self, force_N: Floats, seen_N: Floats, v_a_mps: Floats, seen_mps: Floats) -> None:
        """Take means of the force, v_a by the base's rms, and what the controller saw of both; NaN where it is not known."""
        off_N, known = np.abs(force_N - seen_N), np.isfinite(force_N) & np.isfinite(seen_N)
        least_N = float(np.nan_to_num(self._of.noise["drive_force_N"]))
        self._blocks += int(np.count_nonzero(known))
        other = off_N > np.maximum(_SAME_FORCE * np.maximum(np.abs(force_N), np.abs(seen_N)), least_N)
        self._other += int(np.count_nonzero(known & other))
        both = np.isfinite(v_a_mps) & np.isfinite(seen_mps) & (seen_mps > 0.0)
        if np.count_nonzero(both) >= _FEWEST:
            ratio = float(v_a_mps[both].sum() / seen_mps[both].sum())
            self._looks += 1
            if not 1.0 / _SAME_V_A < ratio < _SAME_V_A:
                self._other_looks, self._ratio = self._other_looks + 1, ratio

    def doubts(self) -> list[Doubt]:
        """What is not the same."""
        found: list[Doubt] = []
        if self._other > _OTHER_SHARE * self._blocks:
            text = f"the drive force of {self._other} of {self._blocks} blocks is not the one with which the controller worked"
            found.append(Doubt("SENSOR_OTHER", text, True))
        if self._other_looks:
            text = f"the base accelerometer shows {self._ratio:.3g} times the v_a with which the controller worked"
            found.append(Doubt("SENSOR_OTHER", text, True))
        return found
