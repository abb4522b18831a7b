"""Relations between the sensors of an axis, second by second: force and spring, and vibration of base, slide and controller.

A channel that is swapped, of the wrong sign or scale, or not connected breaks a relation. A relation is compared in each second
in which its signals exceed their noise; a single broken second is a doubt. "Bank": the simulated axes of docs/method/bank.md.
"""

import math
from typing import NamedTuple

import numpy as np

from bridge.arrays import Bools, Floats
from bridge.log.watches.arrays import noise_of
from bridge.wire import stickslip_pb2 as wire
from cockpit.judge.setup import Described
from cockpit.judge.window import Rows, Window, means

# Force and spring are compared about their means in this many parts of a second, which removes drift, zeros and scales of both
# positions. One part: positions whose scales differ by 0.2 % are doubted at 1 mm/s. More: fewer seconds exceed the noise.
_PARTS = 4
# Power of force or extension over the power of both noises above which a second is compared. Smaller: a larger part of the
# difference is noise, 4 % of the power at 25. Larger: less of a run is compared.
_EXCITED = 25.0
# Least vibration that is compared, in noises of the accelerometer. Smaller: noise counts. Larger: no slow feed is compared.
_SEEN = 100.0
# Share of vibration in a second above which it is compared. Larger: an inching drive is never compared. Smaller: ramps of the
# vibration fill most of a second, at 0.05 in `mount-stops` of the bank; at 0.25 they fill a twelfth at most.
_COMPARED = 0.25
# Allowed factor between v_a in the log and in the controller, either way. Smaller: other vibration of a real base counts, which
# the controller filters out. Larger: clipped accelerometers pass, half of them at 1.5.
_SAME_V_A = 1.25
# rms of the slide over rms of the base under vibration: 0.5 at most in the bank, except in slips. Smaller: a stiff contact
# counts. Larger: swapped accelerometers pass.
_LOUDER = 1.3
# In noises of the slide's accelerometer: a signal below the first is noise alone, and expected friction above the second must
# show. In the bank it shows at least 0.16 of the expectation. Second smaller: the long slip of `drill-string`, 11, counts.
# Larger: less is compared.
_QUIET, _SHAKEN = 2.0, 20.0


class Doubt(NamedTuple):
    """Finding on a faulty channel, or on a broken relation."""

    code: str
    text: str
    decides: bool  # the verdict depends on the channel


class ChannelRelations:
    """All relations of a run, window by window."""

    def __init__(self, of: Described, block_s: float) -> None:
        self._of, self._count = of, round(1.0 / block_s)
        position_N = of.stiffness_N_per_m * of.channels["drive_position_m"].step
        steps_N = [position_N, position_N, of.channels["drive_force_N"].step]
        self._steps_N2 = float(np.nansum(np.square(steps_N))) / 12.0  # noise of the resolutions of positions and force
        self.vibrated = False
        self._broken: dict[str, tuple[str, int]] = {}  # by code: text of the first broken second, and their number

    def add(self, window: Window) -> None:
        """Add a window, cut into seconds backwards from its end; its first second may begin in the window before."""
        count, blocks, of = self._count, window.blocks, self._of
        if window.end < count:
            return
        begins = np.maximum(np.arange(window.end - count, window.first - count, -count)[::-1], 0)
        at, t_s, bins = begins[:, None] + np.arange(count), blocks.t_ns[begins] * 1e-9, blocks.drive_m.shape[1]
        force_N = means(blocks.force_N[at].reshape(at.size, -1), bins).reshape(len(at), -1)
        if of.uses_force and of.uses_slide:
            behind_m = (blocks.drive_m[at] - blocks.slide_m[at]).reshape(len(at), -1)
            self._spring(t_s, force_N, behind_m * of.stiffness_N_per_m)
        self._vibration(t_s, window, at, np.abs(force_N.reshape(*at.shape, bins).mean(axis=2)))

    def _spring(self, t_s: Floats, force_N: Floats, spring_N: Floats) -> None:
        """F = k_d (drive - slide), [seconds, bins]."""
        noise_N2 = noise_of(force_N) ** 2 + noise_of(spring_N) ** 2 + self._steps_N2
        width = force_N.shape[1] // _PARTS
        parts = (signal[:, : _PARTS * width].reshape(-1, _PARTS, width) for signal in (force_N, spring_N))
        force_N, spring_N = (part - part.mean(axis=2, keepdims=True) for part in parts)
        force, spring, apart = (np.square(part).mean(axis=(1, 2)) for part in (force_N, spring_N, force_N - spring_N))
        larger = np.maximum(force, spring)
        text = "drive_force_N varies by {:.3g} N, the described stiffness times drive_position_m - mass_position_m by {:.3g} N, "
        text += (
            "their difference by {:.3g} N: look at sign, scale and cable of these three channels, and at the stiffness"
        )
        broken = (larger > _EXCITED * noise_N2) & (apart > self._of.apart**2 * larger)
        self._take("SENSOR_SCALE", t_s, broken, text, *map(np.sqrt, (force, spring, apart)))

    def _vibration(self, t_s: Floats, window: Window, at: Rows, force_N: Floats) -> None:
        """Base, slide and controller while the rig vibrates, [seconds, blocks]."""

        def compare(code: str, compared: Bools, holds: Bools, text: str, *shown: Floats) -> None:
            wrong, blocks = compared & ~holds, compared.sum(axis=1)
            broken = (blocks >= _COMPARED * self._count) & (wrong.sum(axis=1) > 0.5 * blocks)
            middle = (wrong.cumsum(axis=1) > 0.5 * wrong.sum(axis=1, keepdims=True)).argmax(axis=1)
            self._take(code, t_s, broken, text, *(values[np.arange(len(at)), middle] for values in shown))

        base_noise_mps2, noise_mps2 = (self._of.channels[name].noise for name in ("base_accel_mps2", "mass_accel_mps2"))
        base_mps2, slide_mps2 = window.blocks.base_mps2[at], window.blocks.slide_mps2[at]
        applied = _rows_at(window.applied, "sequence", window.blocks.sequence[at])
        amplitude_m, omega = applied["amplitude_m"], 2.0 * math.pi * applied["frequency_Hz"]
        self.vibrated |= bool((amplitude_m > 0.0).any())
        vibrates = omega**2 * amplitude_m > _SEEN * np.nan_to_num(base_noise_mps2)
        text = "mass_accel_mps2 vibrates by {:.3g} m/s2, more than base_accel_mps2 by {:.3g} m/s2: are they swapped, or is "
        text += "base_accel_mps2 not connected?"
        compare("SENSOR_SWAPPED", vibrates, slide_mps2 <= _LOUDER * base_mps2, text, slide_mps2, base_mps2)
        per_omega_s = np.divide(1.0, omega, out=np.zeros(at.shape), where=vibrates)
        # transmitted by a sticking contact, limited by the sliding friction
        shaken_mps2 = np.minimum(self._of.contact_per_s2 * base_mps2 * per_omega_s**2, force_N / self._of.mass_kg)
        shakes = vibrates & (shaken_mps2 > _SHAKEN * noise_mps2)
        text = "mass_accel_mps2 shows {:.3g} m/s2, its noise, where friction shakes the slide by {:.3g} m/s2: is it connected?"
        compare("SENSOR_DEAD", shakes, slide_mps2 >= _QUIET * noise_mps2, text, slide_mps2, shaken_mps2)
        # the controller does not measure v_a during a loop check
        trace = _rows_at(window.trace, "block", window.blocks.sequence[at])
        v_a_mps = trace["vibration_velocity_mps"]
        both = vibrates & (v_a_mps > 0.0) & (trace["mode"] == wire.EXCITE)
        rolled_off = applied["frequency_Hz"] / self._of.accel_bandwidth_Hz
        shown_mps = math.sqrt(2.0) * base_mps2 * per_omega_s * np.hypot(1.0, rolled_off)
        same = (shown_mps > v_a_mps / _SAME_V_A) & (shown_mps < v_a_mps * _SAME_V_A)
        text = (
            "v_a is {:.3g} m/s by base_accel_mps2 and {:.3g} m/s in the controller: did both receive the same signal?"
        )
        compare("SENSOR_OTHER", both, same, text, shown_mps, v_a_mps)

    def _take(self, code: str, t_s: Floats, broken: Bools, text: str, *shown: Floats) -> None:
        for second in np.flatnonzero(broken).tolist():
            first = f"from {t_s[second]:.1f} s on {text.format(*(values[second] for values in shown))}"
            first, seconds = self._broken.get(code, (first, 0))
            self._broken[code] = first, seconds + 1

    def doubts(self) -> list[Doubt]:
        """A finding for each broken relation."""
        return [Doubt(code, f"{text} ({seconds} s in all)", True) for code, (text, seconds) in self._broken.items()]


def _rows_at(rows: Rows, name: str, number: Rows) -> Rows:
    """The rows with these block numbers, [seconds, blocks]; zeros for a number without a row."""
    rows = np.concatenate([rows, np.zeros(1, rows.dtype)])
    at = np.minimum(np.searchsorted(rows[name][:-1], number), len(rows) - 1)
    return rows[np.where(rows[name][at] == number, at, -1)]
