"""Whether the sensors of a run can carry a verdict: dead, clipped, swapped and absent channels, and three witnesses of slips.

A composition of checks like `bridge.log.in_charge.ChargeWatch`: records by topic in file order, pieces of any size, memory that
does not grow with the log. A check makes no statement where it has nothing to compare.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.log.check.signal_range import Signal, SignalLook
from bridge.log.logfile import block_period_ns
from bridge.units import counted
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import CHANNELS, Records
from cockpit.judge.described import Described
from cockpit.judge.relations import Doubt, SameRelation, ShakenRelation, SpringRelation
from cockpit.judge.slip_witness import PlaceSlips, TraceSlips, behind_noise_m, noise_of, within

Floats = npt.NDArray[np.float64]
TimesS = npt.NDArray[np.floating[Any]]

_BIN_S = 1e-3  # of means, as slips of the force are found in
_AT_ONCE = 1024  # blocks that are looked at together: fewer cost more time a block, more hold more memory
_REST_S = 0.1  # after a vibration until the base counts as at rest
# Noise over resolution from which a live channel never repeats a value for long: 2 sigma are within half a step then, and 0.1 s
# of 20 kHz are never all within them.
_NOISY = 0.25
_DEAD_S = 0.1  # of equal samples, for such a channel
_DEAD_IF_UNKNOWN_S = 1.0  # for one whose noise is not described, as in `log check`
_FROZEN_S = 0.1  # of blocks that repeat the one before
_FEW_AT_END = 20  # samples at the largest value that a live channel with noise has by chance
_CLIPPED_SHARE = 1e-5  # of all samples; the same for a long log
_BEYOND = 1e-3  # of the range, by which a value is beyond it: rounding to float32 is far below
_NOT_FINITE_SHARE = 1e-3  # of the samples, from which a channel is not there
_FEW_SLIPS = 3  # that one witness may see alone: at the edge of a stretch, or of what counts
_MANY_SLIPS = 10  # the same against two that see none; the bank's controller counts up to 7 where nothing slips


class SensorVerdict(NamedTuple):
    """What the sensors say of themselves."""

    findings: list[Doubt]
    by_force: int | None  # slips in the judged stretches; None without a force
    by_place: int | None  # None where the places cannot show one
    by_trace: int
    surges: int  # of `by_trace`

    def as_dict(self) -> dict[str, Any]:
        """For `--json`."""
        return self._asdict() | {"findings": [finding._asdict() for finding in self.findings]}


class SensorWatch:
    """Looks at one log, piece by piece, in file order.

    Args:
        of: the description in the log.
        signals: of the channels, where another check feeds them already; else they are made and fed here.

    """

    def __init__(self, of: Described, signals: dict[str, Signal] | None = None) -> None:
        self._of = of
        self._feeds = signals is None
        self._signals = signals or {name: Signal(dwells=name.endswith("_m")) for name in CHANNELS}
        self.trace_slips = TraceSlips()
        self.place_slips: PlaceSlips | None = None
        self._spring: SpringRelation | None = None
        self._shaken = ShakenRelation(of)
        self._same_seen = SameRelation(of)
        self._steps: list[Floats] = [np.empty(0)] * 3  # block of a step, and the force and v_a that the controller saw
        self._new_steps: list[Floats] = []
        self._period_s = 0.0
        self._bins = self._samples = 1
        self._blocks: list[list[npt.NDArray[Any]]] = []
        self._waiting = 0
        # number of the block, frequency, amplitude, whether the rig vibrates by itself to check the loop
        self._applied: list[Floats] = [np.empty(0)] * 4
        self._new_applied: list[Records] = []
        self._last_number = -1.0
        self._part = 0.0
        self._rested = math.inf  # blocks since the last one with vibration
        self._last: dict[str, npt.NDArray[np.float32]] = {}
        self._same: dict[str, int] = dict.fromkeys(CHANNELS, 0)
        self._most_same: dict[str, int] = dict.fromkeys(CHANNELS, 0)
        self._noise_N = math.inf  # of the force's bins, the smallest seen
        self._vibrated = False

    def sensors(self, records: Records) -> None:
        """Take sensor blocks, [blocks]."""
        if len(records):
            if not self._period_s:
                self._begin(records)
            # plain arrays: records of many fields are joined field by field, which takes ten times as long
            self._blocks.append(
                [records["sequence"], records["t_ns"], *(np.ascontiguousarray(records[name]) for name in CHANNELS)]
            )
            self._waiting += len(records)
            if self._waiting >= 2 * _AT_ONCE:
                self._look(self._waiting - _AT_ONCE // 2)  # what was applied in the newest ones may come later

    def applied(self, records: Records) -> None:
        """Take what the rig did, [blocks]."""
        if len(records):
            self._new_applied.append(records)

    def trace(self, records: Records) -> None:
        """Take steps of the controller, [steps]."""
        self.trace_slips.add(records)
        if len(records):
            seen = (records[name].astype(np.float64) for name in ("block", "drive_force_N", "vibration_velocity_mps"))
            self._new_steps.append(np.stack([*seen]))

    def command(self, records: Records) -> None:
        """Commands say nothing of the sensors."""

    def _look(self, count: int) -> None:
        """Look at the oldest blocks that wait."""
        joined = [np.concatenate(parts) for parts in zip(*self._blocks, strict=True)]
        self._blocks, self._waiting = [[one[count:] for one in joined]], self._waiting - count
        sequence, t_ns, *channels = (one[:count] for one in joined)
        numbers, samples = sequence.astype(np.float64), dict(zip(CHANNELS, channels, strict=True))
        for name, values in samples.items():
            if self._feeds:
                self._signals[name].add(values.ravel())
            self._repeats(name, values)
        force_N, slide_m, drive_m = (
            self._means(samples[name]) for name in ("drive_force_N", "mass_position_m", "drive_position_m")
        )
        block_N = np.where(np.isfinite(force_N), force_N, np.nan).reshape(count, -1).mean(axis=1)
        missing = np.diff(numbers, prepend=self._last_number) != 1.0
        wild = ~np.isfinite(force_N + slide_m + drive_m).reshape(count, -1).all(axis=1)
        part = np.repeat(self._part + np.cumsum(missing | wild), self._bins)
        self._last_number, self._part = float(numbers[-1]), float(part[-1])
        before_s = (np.arange(self._bins) + 1 - self._bins) * (self._period_s / self._bins)
        t_s = (t_ns[:, None] * 1e-9 + before_s).ravel()
        if wild.any():
            good = np.repeat(~wild, self._bins)
            t_s, part, force_N, slide_m, drive_m = (one[good] for one in (t_s, part, force_N, slide_m, drive_m))
        if self.place_slips is not None and self._spring is not None and len(t_s) > 2:
            self.place_slips.add(t_s, drive_m, slide_m, part)
            self._spring.add(t_s, force_N, drive_m - slide_m)
            self._noise_N = min(self._noise_N, noise_of(force_N))
        self._shake(numbers, block_N, samples["base_accel_mps2"], samples["mass_accel_mps2"])

    def _means(self, values: npt.NDArray[np.float32]) -> Floats:
        """Means of the bins, one after the other."""
        parts = values.reshape(len(values) * self._bins, -1).astype(np.float64)
        return np.einsum("ij->i", parts) / parts.shape[1]

    def _begin(self, records: Records) -> None:
        self._period_s = block_period_ns(records) * 1e-9
        self._samples = records["drive_force_N"].shape[1]
        self._bins = math.gcd(self._samples, max(round(self._period_s / _BIN_S), 1))
        bin_s = self._period_s / self._bins
        self.place_slips = PlaceSlips(self._of, bin_s, self._samples // self._bins)
        noise_m = behind_noise_m(self._of, self._samples // self._bins)
        self._spring = SpringRelation(self._of, bin_s, noise_m)
        self._last_number = float(records["sequence"][0]) - 1.0

    def _repeats(self, name: str, values: npt.NDArray[np.float32]) -> None:
        last = self._last.get(name)
        self._last[name] = values[-1:].copy()
        first = values[:, 0]
        maybe = np.flatnonzero(first[1:] == first[:-1]) + 1
        same = np.zeros(len(values), bool)
        if len(maybe):
            same[maybe] = (values[maybe] == values[maybe - 1]).all(axis=1) & (values[maybe] != values[maybe, :1]).any(
                axis=1
            )
        if last is not None:
            same[0] = bool((last == values[:1]).all() and (last != last[:, :1]).any())
        if not same.any():
            self._same[name] = 0
            return
        edges = np.flatnonzero(np.diff(same.astype(np.int8), prepend=0, append=0)).reshape(-1, 2)
        runs = edges[:, 1] - edges[:, 0]
        if same[0]:
            runs[0] += self._same[name]
        self._most_same[name] = max(self._most_same[name], int(runs.max()))
        self._same[name] = int(runs[-1]) if same[-1] else 0

    def _shake(
        self, numbers: Floats, block_N: Floats, base: npt.NDArray[np.float32], slide: npt.NDArray[np.float32]
    ) -> None:
        for new in self._new_applied:
            checks = (new["guard_state"] == wire.CHECKING).astype(np.float64)
            fresh = (new["sequence"].astype(np.float64), new["frequency_Hz"], new["amplitude_m"], checks)
            self._applied = [np.concatenate(both) for both in zip(self._applied, fresh, strict=True)]
        self._new_applied = []
        number, frequency_Hz, amplitude_m, checks = self._applied
        if not len(number):
            return
        at = np.minimum(np.searchsorted(number, numbers), len(number) - 1)
        known = number[at] == numbers
        amplitude_m = np.where(known, amplitude_m[at], np.nan)
        omega = 2.0 * math.pi * frequency_Hz[at]
        steady = np.abs(np.diff(amplitude_m, prepend=np.nan)) < 0.02 * amplitude_m
        shaken = ~(amplitude_m == 0.0)
        self._vibrated = self._vibrated or bool((amplitude_m > 0.0).any())
        index = np.arange(len(numbers), dtype=np.float64)
        last = np.maximum.accumulate(np.where(shaken, index, -1.0 - self._rested))
        rests = (index - last) * self._period_s > _REST_S
        self._rested = float(index[-1] - last[-1])
        commanded = np.where(steady & known, omega**2 * amplitude_m / math.sqrt(2.0), 0.0)
        base_mps2 = _rms(base)
        well = self._shaken.add(base_mps2, _rms(slide), commanded, rests) & (checks[at] == 0.0)
        v_a_mps = np.divide(math.sqrt(2.0) * base_mps2, omega, out=np.full(len(omega), np.nan), where=well)
        self._compare(numbers, block_N, v_a_mps)
        keep = number > numbers[-1]
        self._applied = [one[keep] for one in self._applied]

    def _compare(self, numbers: Floats, block_N: Floats, v_a_mps: Floats) -> None:
        block, seen_N, seen_mps = steps = np.concatenate([np.stack(self._steps), *self._new_steps], axis=1)
        self._new_steps = []
        if not len(block):
            return
        at = np.minimum(np.searchsorted(block, numbers), len(block) - 1)
        known = block[at] == numbers
        self._same_seen.add(
            block_N, np.where(known, seen_N[at], np.nan), v_a_mps, np.where(known, seen_mps[at], np.nan)
        )
        self._steps = list(steps[:, block > numbers[-1]])

    def result(
        self, force_slips_s: TimesS | None = None, judged: Sequence[tuple[float, float]] | None = None
    ) -> SensorVerdict:
        """All of it, at the end of the log.

        Args:
            force_slips_s: times of the slips in the drive force [s]; None where nobody counted them.
            judged: stretches [s] in which slips count; None: from a second after the controller is enabled.

        """
        if self._waiting:
            self._look(self._waiting)
        findings: list[Doubt] = []
        for name in CHANNELS:
            if self._period_s:
                findings += self._of_channel(name, self._signals[name].result())
        broken = {finding.text.partition(" ")[0] for finding in findings if finding.decides}
        if self._spring is not None and not {"drive_force_N", "mass_position_m", "drive_position_m"} & broken:
            findings += self._spring.doubts() if self._of.uses_force and self._of.uses_slide else []
        if "base_accel_mps2" not in broken:
            findings += self._shaken.doubts()
        if "drive_force_N" not in broken and "base_accel_mps2" not in broken:
            findings += self._same_seen.doubts()
        begin_s = self._of.enabled_from_s + (1.0 if self._of.enabled_from_s > 0.0 else 0.0)
        stretches = judged if judged is not None else [(begin_s, math.inf)]
        return self._slips(findings, force_slips_s, stretches)

    def _of_channel(self, name: str, seen: SignalLook) -> list[Doubt]:
        of, found = self._of, list[Doubt]()
        sample_s = self._period_s / self._samples
        decides = self._decides(name)
        noise, step, (low, high) = of.noise[name], of.step[name], of.ends[name]
        noisy = noise > 0.0 and noise >= _NOISY * step
        if not seen.samples:
            return found
        if seen.not_finite > _NOT_FINITE_SHARE * seen.samples:
            text = f"{name} has no number in {100.0 * seen.not_finite / seen.samples:.3g} % of its samples"
            found.append(Doubt("SENSOR_ABSENT", text, decides))
        if seen.constant and seen.lowest == 0.0:
            return [
                *found,
                Doubt("SENSOR_ABSENT", f"{name} is 0 in all {seen.samples} samples: not connected", decides),
            ]
        longest_s = seen.longest_run * sample_s
        at_end = seen.longest_run_value in (low, high)
        if seen.constant or longest_s > (_DEAD_S if noisy and not at_end else _DEAD_IF_UNKNOWN_S):
            if seen.constant or noisy or not math.isfinite(noise):
                from_s = (seen.longest_run_end - seen.longest_run + 1) * sample_s
                text = (
                    f"{name} stands at {seen.longest_run_value:.6g} for {longest_s:.3g} s from {from_s:.2f} s on: dead"
                )
                found.append(Doubt("SENSOR_DEAD", text, decides))
        elif self._most_same[name] * self._period_s > _FROZEN_S:
            text = f"{name} repeats one block for {self._most_same[name] * self._period_s:.3g} s: frozen"
            found.append(Doubt("SENSOR_FROZEN", text, decides))
        room = _BEYOND * (high - low) if math.isfinite(high - low) else math.inf
        if seen.highest > high + room or seen.lowest < low - room:
            value = seen.highest if seen.highest > high + room else seen.lowest
            text = f"{name} shows {value:.4g}, beyond its range of {low:g} to {high:g}: another signal or unit"
            found.append(Doubt("SENSOR_SWAPPED", text, decides))
        most = max(_FEW_AT_END, _CLIPPED_SHARE * seen.samples)
        flat = noisy and not name.endswith("_m")
        for value, runs, at, end in (
            (seen.highest, seen.clipped_high, seen.at_highest, high),
            (seen.lowest, seen.clipped_low, seen.at_lowest, low),
        ):
            idles = value == 0.0  # a sensor of one sign at rest clips its noise there, and nothing is lost
            ends = abs(value - end) <= 1e-6 * abs(end) and math.isfinite(end) and at > _FEW_AT_END
            if not idles and (runs or (flat and at > most) or ends) and not seen.constant:
                text = (
                    f"{name} is cut at {value:.4g} in {counted(max(at, runs), 'sample')}: more was there than it shows"
                )
                found.append(Doubt("SENSOR_CLIPPED", text, decides))
        return found

    def _decides(self, name: str) -> bool:
        """Whether a verdict rests on a channel."""
        of = self._of
        described = math.isfinite(of.noise[name])
        return {
            "drive_force_N": of.uses_force,
            "mass_position_m": of.uses_slide,
            "drive_position_m": True,
            "base_accel_mps2": self._vibrated,
            "mass_accel_mps2": described,  # by it the controller knows accelerometers that are swapped
        }[name]

    def _slips(self, findings: list[Doubt], force_slips_s: TimesS | None, judged: Any) -> SensorVerdict:
        trace, place = self.trace_slips, self.place_slips
        trace_s, surges_s = trace.slips.all(), trace.surges.all()
        place_s = place.times.all() if place is not None else np.empty(0)
        by_place = within(place_s, judged) if place is not None and (place.sees or len(place_s)) else None
        surges = within(surges_s, judged)
        slips = within(trace_s, judged)  # a controller counts surges at stops and turns as well: they are no witness
        by_trace = slips + surges
        by_force = within(force_slips_s, judged) if force_slips_s is not None else None
        if by_force is not None and self._of.uses_force and force_slips_s is not None:
            whole = (len(place_s), len(trace_s))
            counted_alone = _MANY_SLIPS if by_place is not None else _FEW_SLIPS
            # two witnesses that agree are more than one
            missed = by_force == 0 and (min(by_place or 0, slips) > 0 or (by_place or 0) >= _FEW_SLIPS)
            missed = missed or (by_force == 0 and slips >= counted_alone and self._of.drop_N != 0.0)
            missed = missed or (len(force_slips_s) == 0 and min(whole) > 0)
            alone = by_force >= _MANY_SLIPS and by_place == 0 and by_trace == 0
            if missed or alone:
                shown = "cannot show slips" if by_place is None else f"show {counted(by_place, 'slip')}"
                text = (
                    f"the drive force shows {counted(by_force, 'slip')}, the places of drive and slide {shown}, the controller "
                    f"counted {counted(by_trace, 'slip')}, {surges} of them surges; over the whole log {len(force_slips_s)}, "
                    f"{whole[0]} and {whole[1] + len(surges_s)}"
                )
                findings = [*findings, Doubt("SLIPS_DISAGREE", text, True)]
        noise_N, fall_N = 10.0 * self._noise_N, 2.0 * self._of.drop_N
        natural_m = self._of.slip_m
        if self._of.uses_force and math.isfinite(noise_N) and natural_m > 0.0 and noise_N > fall_N:
            text = f"drive_force_N has noise of {self._noise_N:.3g} N in 1 ms, in which a slip of {fall_N:.3g} N is not seen"
            findings = [*findings, Doubt("SENSOR_NOISE", text, True)]
        return SensorVerdict(findings, by_force, by_place, by_trace, surges)


def _rms(values: npt.NDArray[np.float32]) -> Floats:
    """Root mean square of blocks about their means, [blocks]."""
    mean = np.einsum("ij->i", values) / values.shape[1]
    square = np.einsum("ij,ij->i", values, values) / values.shape[1] - mean * mean
    return np.sqrt(np.maximum(square, 0.0)).astype(np.float64)
