"""What the sensors of an axis must have to do with each other: force and spring, and the log with what its controller saw.

A channel that is swapped with another one, of the wrong sign or scale, or not connected breaks a relation of physics that the
other channels keep. A relation says nothing where nothing moves enough to stand out from noise.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.log.watches.arrays import median
from bridge.wire import stickslip_pb2 as wire
from cockpit.judge.described import Described
from cockpit.judge.window import Rows, Window

Floats = npt.NDArray[np.float64]

# Force and spring are compared about their means in parts of this length: drift and zeros of the sensors fall out. Longer: drift
# counts; shorter: fewer parts stand out from noise.
_PART_S = 0.25
_PARTS = 4  # with a result of their own, 1 s. More: a channel that fails late passes; fewer: the slope is less sure
# Variance of the spring's extension over that of its noise, from which a part counts. Smaller: noise makes k_d too small, by 4 %
# at 25; larger: less of a run is compared.
_EXCITED = 25.0
_SIGMAS = 5.0  # of the slope by which it is outside. Smaller: chance counts; larger: a wrong scale in noise passes
_EXPLAINED = (
    0.25  # of the force's variance by a spring of the wrong sign. Smaller: inertia counts; larger: a swap passes
)
# Least vibration that is compared, in noise of the accelerometer. Smaller: noise counts; larger: nothing is left of slow feeds.
_SEEN = 100.0
# Change of the amplitude from block to block. Larger: ramps count, in which v_a is behind; smaller: few blocks are left.
_STEADY = 0.02
# Factor between v_a in the log and in the controller, either way. Smaller: the accelerometer's roll-off, which the controller
# corrects for, counts; larger: a scale of 0.4 passes. In the bank: 0.97 to 1.1.
# rms of the slide over that of the base under vibration, and the share of the blocks in which it is more. Smaller: slips under a
# vibration that is too weak, 5 % of the blocks in the bank, count; larger: a swap in the last fifth of a run passes.
_LOUDER, _LOUDER_SHARE = 1.3, 0.2
_SAME_V_A = 2.2
_SAME_FORCE = 0.02  # of the force, up to which log and controller have the same: equal to the last bit in a sound log
# Blocks that differ. Larger: a channel that fails late passes; smaller: v_a after ramps counts, 0.014 where a drive inches.
_OTHER_SHARE = 0.05


class Doubt(NamedTuple):
    """A channel that is wrong by itself, or a relation that does not hold."""

    code: str
    text: str
    decides: bool


class SpringRelation:
    """F = k_d (drive - slide), in parts of a quarter of a second."""

    def __init__(self, of: Described) -> None:
        self._of = of
        self.compared = 0  # seconds with motion
        self._wrong: list[tuple[float, float]] = []  # time and ratio, of the first second and of as many as were wrong

    def add(self, t_s: Floats, force_N: Floats, behind_m: Floats, bin_s: float) -> None:
        """Take the bins of a window, [bins]; behind_m is drive less slide."""
        width = max(round(_PART_S / bin_s), 8)
        seconds = len(t_s) // (width * _PARTS)
        parts = (one[: seconds * _PARTS * width].reshape(seconds, _PARTS, width) for one in (force_N, behind_m))
        force_N, behind_m = (one - one.mean(axis=2, keepdims=True) for one in parts)
        for at, (force, behind) in enumerate(zip(force_N, behind_m, strict=True)):
            noise_m = median(np.abs(np.diff(behind, 2)).ravel()) / 0.6745 / math.sqrt(6.0)
            excited = (behind**2).mean(axis=1) > _EXCITED * max(noise_m, 1e-12) ** 2
            if excited.any():
                self._compare(float(t_s[at * _PARTS * width]), force[excited].ravel(), behind[excited].ravel())

    def _compare(self, at_s: float, force_N: Floats, behind_m: Floats) -> None:
        slope = float(force_N @ behind_m / (behind_m @ behind_m))
        left_N2 = float(np.square(force_N - slope * behind_m).sum())
        spread = _SIGMAS * math.sqrt(left_N2 / len(force_N) / float(behind_m @ behind_m)) / self._of.stiffness_N_per_m
        ratio = slope / self._of.stiffness_N_per_m
        if not math.isfinite(ratio):
            return
        self.compared += 1
        opposite = ratio + spread < 0.0 and left_N2 < (1.0 - _EXPLAINED) * float(force_N @ force_N)
        if opposite or 0.0 < ratio + spread < 1.0 / self._of.off or ratio - spread > self._of.off:
            self._wrong.append((at_s, ratio))

    def doubts(self) -> list[Doubt]:
        """What does not hold."""
        if not self._wrong:
            return []
        (from_s, ratio), k_d = self._wrong[0], self._of.stiffness_N_per_m
        text = (
            f"the drive force changes by {ratio * k_d:.3g} N per m of drive less slide, the spring has {k_d:.3g} N/m "
            f"(in {len(self._wrong)} of {self.compared} s with motion, first at {from_s:.1f} s): the force or a position has "
            "another sign or scale, is another signal, or not connected"
        )
        return [Doubt("SENSOR_SCALE" if ratio > 0.0 else "SENSOR_SWAPPED", text, True)]


class SameRelation:
    """The log holds the force and the base's vibration with which the controller worked, and the base vibrates, not the slide."""

    def __init__(self, of: Described) -> None:
        self._of = of
        self.vibrated = False
        self._forces = self._other_forces = self._v_a = self._other_v_a = self._vibrating = self._louder = 0

    def add(self, window: Window, rows: slice, force_N: Floats) -> None:
        """Take the rows of a window, with the mean forces of their blocks, [blocks]."""
        number = window.blocks.sequence[rows]
        trace, seen = _rows_at(window.trace, "block", number)
        applied, known = _rows_at(window.applied, "sequence", number)
        amplitude_m, omega = np.where(known, applied["amplitude_m"], np.nan), 2.0 * math.pi * applied["frequency_Hz"]
        self.vibrated |= bool((amplitude_m > 0.0).any())
        least_N = float(np.nan_to_num(self._of.channels["drive_force_N"].noise))
        seen_N = trace["drive_force_N"]
        other = np.abs(force_N - seen_N) > np.maximum(
            _SAME_FORCE * np.maximum(np.abs(force_N), np.abs(seen_N)), least_N
        )
        self._forces += int(np.count_nonzero(seen))
        self._other_forces += int(np.count_nonzero(seen & other))
        noise_mps2 = float(np.nan_to_num(self._of.channels["base_accel_mps2"].noise))
        steady = np.abs(np.diff(amplitude_m, prepend=np.nan)) < _STEADY * amplitude_m
        v_a_mps = trace["vibration_velocity_mps"]
        vibrating = steady & (omega**2 * amplitude_m > _SEEN * noise_mps2)
        base_mps2, slide_mps2 = window.blocks.base_mps2[rows], window.blocks.slide_mps2[rows]
        self._vibrating += int(np.count_nonzero(vibrating))
        self._louder += int(np.count_nonzero(vibrating & (slide_mps2 > _LOUDER * base_mps2)))
        # while the rig checks its loop the controller does not follow the vibration
        both = seen & vibrating & (v_a_mps > 0.0) & (trace["mode"] == wire.EXCITE)
        ratio = math.sqrt(2.0) * base_mps2[both] / (omega[both] * v_a_mps[both])
        self._v_a += len(ratio)
        self._other_v_a += int(np.count_nonzero(~((ratio > 1.0 / _SAME_V_A) & (ratio < _SAME_V_A))))

    def doubts(self) -> list[Doubt]:
        """What is not the same."""
        found: list[Doubt] = []
        for what, other, blocks in (
            ("drive force", self._other_forces if self._of.uses_force else 0, self._forces),
            ("vibration of the base accelerometer", self._other_v_a, self._v_a),
        ):
            if other > _OTHER_SHARE * blocks:
                text = f"the {what} in {other} of {blocks} blocks is not the one with which the controller worked"
                found.append(Doubt("SENSOR_OTHER", text, True))
        if self._louder > _LOUDER_SHARE * self._vibrating:
            text = (
                f"the slide vibrates more than the base in {self._louder} of {self._vibrating} blocks with vibration: both "
                "accelerometers are swapped, or the base's is another signal"
            )
            found.append(Doubt("SENSOR_SWAPPED", text, True))
        return found


def _rows_at(rows: Rows, name: str, number: Rows) -> tuple[Rows, npt.NDArray[np.bool_]]:
    """The rows with these numbers of blocks, [blocks], and whether there is one; else the row is one of zeros."""
    rows = np.concatenate([rows, np.zeros(1, rows.dtype)])
    at = np.minimum(np.searchsorted(rows[name][:-1], number), len(rows) - 1)
    known = (rows[name][at] == number) & (at < len(rows) - 1)
    return rows[np.where(known, at, -1)], known
