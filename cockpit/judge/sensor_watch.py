"""Whether the sensors of a run can support a verdict: dead, clipped, swapped and absent channels, and three counts of slips.

Relations between the sensors, second by second: force and spring, and vibration of base, slide and controller. A channel that
is swapped, of the wrong sign or scale, or not connected breaks a relation. A relation is compared in each second in which its
signals exceed their noise; a single broken second is a doubt. The slope of the force over the elongation shows k_d.
"Bank": the simulated axes of docs/method/bank.md.

Only the list of slip times grows with the run. A check without signals to compare has no finding.
"""

import math
from typing import NamedTuple

import numpy as np

from bridge.arrays import Bools, Floats
from bridge.log.check.channel import FEW_AT_END, channel_findings
from bridge.log.check.log_check import LogWatch
from bridge.log.watches.arrays import noise_of
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.channels import CHANNELS
from cockpit.judge.phases import Stretches, within
from cockpit.judge.setup import Described
from cockpit.judge.slips import Forces
from cockpit.judge.watches import FrozenWatch
from cockpit.judge.window import Rows, Window, means

_FROZEN_S = 0.1  # longest allowed repetition of a block. Larger: a failure passes. Smaller: one doubled block counts
# Share of samples that are not finite above which a channel cannot support a verdict. Larger: slips may hide in these samples.
# Smaller: one dropout prevents the verdict on a long run.
_NOT_FINITE_SHARE = 1e-3
_CODES = {"not-finite": "SENSOR_ABSENT", "dead": "SENSOR_DEAD", "clipped": "SENSOR_CLIPPED"}

# Force and spring force are compared less their means in each of so many parts of a second: so drift, zeros and scale errors of
# both positions do not count. One part: positions whose scales differ by 0.2 % are doubted at 1 mm/s. More: fewer seconds exceed
# the noise.
_PARTS = 4
# A second is compared if the power of force or spring force exceeds the power of both noises by this factor. Smaller: more of the
# difference is noise, 4 % of the power at 25. Larger: less of a run is compared.
_EXCITED = 25.0
# Least square of the correlation of force and elongation for a stiffness. Smaller: a swapped channel shows a stiffness. Larger: a
# drive with backlash or damping shows none.
_ALIKE = 0.5
# Factor from which a configured k_d is reported. Smaller: data sheets without bearings are. Larger: only wrong units are.
_FAR = 2.0
# Least vibration that is compared, in noises of the accelerometer. Smaller: noise counts. Larger: no slow feed is compared.
_SEEN = 100.0
# Least vibration that some sensor or the controller shows, over the command. Smaller: a dead exciter leaves noise, up to 0.014 of
# the least command that is compared, and it counts. Larger: a weak exciter is not compared.
_ARRIVES = 0.03
# A second is compared if it vibrates for at least this share. Larger: an inching drive is never compared. Smaller: ramps of the
# vibration fill most of the compared time, at 0.05 in `mount-stops` of the bank; at 0.25 they fill a twelfth at most.
_COMPARED = 0.25
# Allowed factor, either way, between v_a by base_accel_mps2 in the log and v_a in the controller. Smaller: other vibration of a
# real base counts, which the controller filters out. Larger: clipped accelerometers pass, half of them at 1.5.
_SAME_V_A = 1.25
# Allowed rms of the slide's accelerometer under vibration, over the rms of the base's: 0.5 at most in the bank, except in slips.
# Smaller: a stiff contact counts as swapped. Larger: swapped accelerometers pass.
_LOUDER = 1.3
# In noises of the slide's accelerometer: below the first its signal is noise alone; where friction should shake the slide by more
# than the second, the signal must exceed the first. In the bank it shows at least 0.16 of the expectation. Second smaller: the
# long slip of `drill-string`, 11, counts. Larger: less is compared.
_QUIET, _SHAKEN = 2.0, 20.0


class Doubt(NamedTuple):
    """Finding on a faulty channel, or on a broken relation between channels."""

    code: str
    text: str
    decides: bool  # the verdict depends on the channel


class ChannelRelations:
    """All relations of a run, window by window."""

    def __init__(self, of: Described, block_s: float) -> None:
        self._of, self._count = of, round(1.0 / block_s)
        position_N = of.stiffness_N_per_m * of.channels["drive_position_m"].step
        # powers of rounding to the resolutions, of the force and of both positions
        self._steps_N2 = (
            np.nan_to_num(np.square([of.channels["drive_force_N"].step, math.sqrt(2.0) * position_N])) / 12.0
        )
        # powers of force, spring force and their product, in seconds in which both exceed their noise
        self._force_N2 = self._spring_N2 = self._product_N2 = 0.0
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
        """Compare the force with the spring force k_d (drive - slide), [seconds, bins]."""
        noises_N2 = [
            noise_of(values) ** 2 + step for values, step in zip((force_N, spring_N), self._steps_N2, strict=True)
        ]
        width = force_N.shape[1] // _PARTS
        parts = (signal[:, : _PARTS * width].reshape(-1, _PARTS, width) for signal in (force_N, spring_N))
        force_N, spring_N = (part - part.mean(axis=2, keepdims=True) for part in parts)
        force, spring, apart = (np.square(part).mean(axis=(1, 2)) for part in (force_N, spring_N, force_N - spring_N))
        both = (force > _EXCITED * noises_N2[0]) & (spring > _EXCITED * noises_N2[1])
        self._force_N2 += float(force[both].sum())
        self._spring_N2 += float(spring[both].sum())
        self._product_N2 += float((force_N * spring_N).mean(axis=(1, 2))[both].sum())
        larger = np.maximum(force, spring)
        text = "drive_force_N varies by {:.3g} N, the described stiffness times drive_position_m - mass_position_m by {:.3g} N, "
        text += (
            "their difference by {:.3g} N: look at sign, scale and cable of these three channels, and at the stiffness"
        )
        broken = (larger > _EXCITED * sum(noises_N2)) & (apart > self._of.apart**2 * larger)
        self._take("SENSOR_SCALE", t_s, broken, text, *map(np.sqrt, (force, spring, apart)))

    def _vibration(self, t_s: Floats, window: Window, at: Rows, force_N: Floats) -> None:
        """Compare both accelerometers and the controller's v_a while the rig vibrates; `at`: rows, [seconds, blocks]."""

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
        # the controller does not measure v_a during a loop check
        trace = _rows_at(window.trace, "block", window.blocks.sequence[at])
        v_a_mps = np.where(trace["mode"] == wire.EXCITE, trace["vibration_velocity_mps"], 0.0)
        slide_above_mps2 = np.where(slide_mps2 > _QUIET * np.nan_to_num(noise_mps2), slide_mps2, 0.0)
        shown_mps2 = np.fmax.reduce([math.sqrt(2.0) * base_mps2, math.sqrt(2.0) * slide_above_mps2, omega * v_a_mps])
        commanded_mps2 = omega**2 * amplitude_m
        vibrates = commanded_mps2 > _SEEN * np.nan_to_num(base_noise_mps2)
        vibrates &= shown_mps2 > _ARRIVES * commanded_mps2
        text = "mass_accel_mps2 vibrates by {:.3g} m/s2, more than base_accel_mps2 by {:.3g} m/s2: are they swapped, or is "
        text += "base_accel_mps2 not connected?"
        compare("SENSOR_SWAPPED", vibrates, slide_mps2 <= _LOUDER * base_mps2, text, slide_mps2, base_mps2)
        per_omega_s = np.divide(1.0, omega, out=np.zeros(at.shape), where=vibrates)
        # expected vibration of the slide: transmitted by a sticking contact, limited by the sliding friction
        shaken_mps2 = np.minimum(self._of.contact_per_s2 * base_mps2 * per_omega_s**2, force_N / self._of.mass_kg)
        # friction reverses, and shakes the slide, only where the base is faster than the drive
        reverses = math.sqrt(2.0) * base_mps2 * per_omega_s > np.abs(trace["drive_velocity_mps"])
        shakes = vibrates & reverses & (shaken_mps2 > _SHAKEN * noise_mps2)
        text = "mass_accel_mps2 shows {:.3g} m/s2, its noise, where friction shakes the slide by {:.3g} m/s2: is it connected?"
        compare("SENSOR_DEAD", shakes, slide_mps2 >= _QUIET * noise_mps2, text, slide_mps2, shaken_mps2)
        both = vibrates & (v_a_mps > 0.0)
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

    def other_stiffness(self, given_N_per_m: float) -> list[str]:
        """A warning about a configured k_d that is far from the slope of the force over the elongation; empty without one."""
        if not given_N_per_m or self._product_N2 <= math.sqrt(_ALIKE * self._force_N2 * self._spring_N2):
            return []
        shown_N_per_m = self._of.stiffness_N_per_m * self._product_N2 / self._spring_N2
        if 1.0 / _FAR <= shown_N_per_m / given_N_per_m <= _FAR:
            return []
        line = f"controller.drive_stiffness_N_per_m = {given_N_per_m:.3g}: the run shows {shown_N_per_m:.3g}"
        return [f"{line}, more than a factor of {_FAR:g} away; correct it, or leave it out"]

    def doubts(self) -> list[Doubt]:
        """A finding for each broken relation."""
        return [Doubt(code, f"{text} ({seconds} s in all)", True) for code, (text, seconds) in self._broken.items()]


def _rows_at(rows: Rows, name: str, number: Rows) -> Rows:
    """The rows with these block numbers, [seconds, blocks]; zeros for a number without a row."""
    rows = np.concatenate([rows, np.zeros(1, rows.dtype)])
    at = np.minimum(np.searchsorted(rows[name][:-1], number), len(rows) - 1)
    return rows[np.where(rows[name][at] == number, at, -1)]


class SensorVerdict(NamedTuple):
    """Findings on the sensors, and three counts of slips."""

    findings: list[Doubt]
    by_force: int  # slips in the judged stretches, by the drive force
    by_position: int | None  # slips by both positions; None if these cannot show a slip
    by_trace: int  # slips and surges counted by the controller
    surges: int  # surges alone


class SensorWatch:
    """Checks the channels of one log, their repeated blocks, and window by window slips and relations."""

    def __init__(self, of: Described, log: LogWatch, frozen: FrozenWatch, block_s: float) -> None:
        self._of, self._log, self._frozen = of, log, frozen
        self._relations = ChannelRelations(of, block_s)
        # smallest fall of force, and of drive less slide, that counts as a slip: the largest of all windows
        self._least_N = self._least_m = 0.0
        self._slips_s: dict[str, list[Floats]] = {"position": [], "slips": [], "surges": []}

    def add(self, window: Window, forces: Forces) -> None:
        """Add a window with its slips by force and by position."""
        self._relations.add(window)
        self._least_N, self._least_m = max(self._least_N, forces.least_N), max(self._least_m, forces.least_m)
        self._slips_s["position"].append(forces.by_position_s)
        trace, judged = window.trace, window.own(window.trace)
        for name in ("slips", "surges"):
            # a restarted controller counts from 0
            more = np.maximum(np.diff(trace[name], prepend=trace[name][:1]), 0)
            self._slips_s[name].append(np.repeat(trace["t_ns"][judged] * 1e-9, more[judged]))

    def other_stiffness(self, given_N_per_m: float) -> list[str]:
        """A warning about a configured k_d that the run contradicts; empty without one."""
        return self._relations.other_stiffness(given_N_per_m)

    def result(self, force_slips_s: Floats, judged: Stretches) -> SensorVerdict:
        """Findings at the end of the log, with the slip times of the force; `judged`: stretches in which slips count."""
        of = self._of
        findings = [doubt for name in CHANNELS for doubt in self._of_channel(name)]
        broken = [doubt.text.partition(" ")[0] for doubt in findings]
        findings += [doubt for doubt in self._relations.doubts() if not any(name in doubt.text for name in broken)]
        slips_s = {name: np.concatenate([np.empty(0), *parts]) for name, parts in self._slips_s.items()}
        slips_s["force"] = force_slips_s
        in_log = {name: len(at_s) for name, at_s in slips_s.items()}
        inside = {name: int(within(at_s, judged).sum()) for name, at_s in slips_s.items()}
        # Surges do not decide: they occur at stops and turns as well. Nor does the controller alone: in the simulated axes of
        # docs/method/bank.md it counts up to 7 false slips.
        if of.uses_force and any(not by["force"] and by["position"] and by["slips"] for by in (inside, in_log)):
            text = "{force} by drive_force_N, {position} by the positions and {slips} by the controller"
            text = f"slips with the controller in charge: {text.format(**inside)}; in the whole log: {text.format(**in_log)}"
            findings.append(Doubt("SLIPS_DISAGREE", text, True))
        if of.uses_force and of.slip_m > 0.0 and of.fall_N < self._least_N < math.inf:
            text = f"drive_force_N is too noisy: it shows falls above {self._least_N:.3g} N only, and a slip is {of.fall_N:.3g} N"
            findings.append(Doubt("SENSOR_NOISE", text, True))
        by_position = inside["position"] if self._least_m < of.slip_m or in_log["position"] else None
        by_trace = inside["slips"] + inside["surges"]
        return SensorVerdict(findings, inside["force"], by_position, by_trace, inside["surges"])

    def _of_channel(self, name: str) -> list[Doubt]:
        seen, log, decides = self._log.signals[name].result(), self._log, self._decides(name)
        few = {"not-finite": _NOT_FINITE_SHARE * seen.samples, "clipped": FEW_AT_END}
        doubts = [
            Doubt(_CODES[finding.kind], f"{name} {finding.text}", decides)
            for finding in channel_findings(name, seen, log.sample_s, self._of.channels[name])
            if finding.times > few.get(finding.kind, 0)
        ]
        repeats_s = self._frozen.runs[name].longest * log.period_ns * 1e-9
        if repeats_s > _FROZEN_S:
            doubts.append(Doubt("SENSOR_FROZEN", f"{name} repeats one block for {repeats_s:.3g} s", decides))
        return doubts

    def _decides(self, name: str) -> bool:
        """True if the verdict depends on a channel."""
        return {
            "drive_force_N": self._of.uses_force,
            "mass_position_m": self._of.uses_slide,
            "drive_position_m": True,
            "base_accel_mps2": self._relations.vibrated,
            # only with a described noise; the controller detects swapped accelerometers with this channel
            "mass_accel_mps2": math.isfinite(self._of.channels["mass_accel_mps2"].noise),
        }[name]
