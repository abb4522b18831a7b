"""A check of a rig with its exciter at rest: rate, lost and unreadable data, the samples of each channel; each with a remedy."""

import math
import time
from typing import NamedTuple

import numpy as np

from bridge.arrays import Floats
from bridge.results import in_json
from bridge.rig.derived import Derived
from bridge.rig.device import Device, reason_of, wrong_shape
from bridge.rig.file import DeviceRig
from bridge.wire.channels import CHANNELS, SENSOR_CHANNELS

# Largest deviation of the measured rate. Smaller: 5 s of blocks that arrive 1 ms early or late show it. Larger: v_d is as wrong.
_RATE = 2e-3
# Share of samples at one end of the range seen from which a channel counts as clipped. Smaller: a quiet channel with a coarse
# step, which repeats its ends. Larger: a channel that clips rarely passes.
_AT_END = 0.05
_FEW_STEPS = 8  # different values up to which a channel is coarse, and its ends prove nothing
# Amplitude of the mains in rms of the other noise that is reported. Smaller: 5 s of noise alone reach 0.03. Larger: hum that the
# controller reads as motion passes.
_HUM = 1.0
_MAINS_HZ = (50.0, 60.0)
_MAINS_DRIFT_HZ = 0.2  # of a public grid
_AROUND_HZ = (
    3.0  # distance from the mains that shows other tones; smaller: slips that follow each other faster count as hum
)
_JITTER_BLOCKS = 20.0  # longest gap between two blocks, in block lengths; the controller's STALE is 20 ms


class Problem(NamedTuple):
    """A finding of the check."""

    place: str  # a channel, or the device
    text: str
    remedy: str


class ChannelCheck(NamedTuple):
    """The samples of one channel, in SI units; NaN without a finite sample."""

    name: str
    absent: bool
    lowest: float
    mean: float
    highest: float
    noise: float  # rms of the differences of neighbouring samples, over sqrt(2)
    hum: float  # amplitude of 50 or 60 Hz above the frequencies around it, the larger one
    missing: float  # share of samples that are NaN


class RigCheck(NamedTuple):
    """Result of a check."""

    rig: str
    seconds: float
    rate_Hz: float  # measured by the computer's clock; 0 for a device without a clock
    blocks: int
    lost: int
    longest_gap_s: float
    answer_s: float  # answer time of a separate exciter; 0: the device has the exciter
    channels: list[ChannelCheck]
    problems: list[Problem]
    warnings: list[Problem]  # findings that do not fail the check

    @in_json
    def ok(self) -> bool:
        """Whether nothing was found."""
        return not self.problems

    def in_words(self) -> list[str]:
        """Lines for the operator."""
        lines = [
            f"rig      {self.rig}: {self.blocks} blocks in {self.seconds:.1f} s, {self.rate_Hz:.0f} samples a second"
        ]
        if self.answer_s:
            lines.append(f"exciter  answers in {self.answer_s * 1e3:.1f} ms")
        for row in self.channels if self.blocks else []:
            shown = f"{row.lowest:.4g} to {row.highest:.4g}, noise {row.noise:.3g}, hum {row.hum:.3g}"
            lines.append(f"channel  {row.name:<18} {'absent' if row.absent else shown}")
        lines += [f"problem  {problem.place}: {problem.text}; {problem.remedy}" for problem in self.problems]
        lines += [f"warning  {warning.place}: {warning.text}; {warning.remedy}" for warning in self.warnings]
        return [*lines, "check    ok" if self.ok else f"check    {len(self.problems)} problems"]


class _Heard:
    """Blocks and failures of a device."""

    def __init__(self) -> None:
        self.samples: list[Floats] = []
        self.at_s: list[float] = []
        self.lost = 0
        self.dropped = ""
        self.failure = ""


def check(device: Device, rig: DeviceRig, seconds: float) -> RigCheck:
    """Check an open device for a time, with its exciter at rest."""
    heard = _listen(device, rig.exciter.frequency_max_Hz, seconds)
    blocks = len(heard.samples)
    raw = Derived(rig)(np.concatenate(heard.samples, axis=1) if blocks else np.empty((rig.sources, 0)))
    rate_Hz, gap_s = _rate(device, heard)
    channels = [_channel(rig, name, raw) for name in CHANNELS]
    problems = _of_device(device, heard, rate_Hz, gap_s)
    if 2.0 * device.answer_s > device.watchdog_s > 0.0:
        text = f"it answers in {device.answer_s * 1e3:.0f} ms, so that a burst of {device.watchdog_s * 1e3:.0f} ms ends early"
        problems.append(Problem("exciter", text, "raise burst_s"))
    warnings: list[Problem] = []
    if not (device.watchdog_s or rig.exciter.watchdog_s):
        text = "it has no burst and no watchdog: a killed process leaves it on"
        warnings.append(
            Problem("exciter", text, "use bursts, or state exciter.watchdog_s of a device that has a watchdog")
        )
    if blocks:
        problems += [problem for row in channels if not row.absent for problem in _of_channel(rig, row, raw)]
    return RigCheck(
        rig.name, seconds, rate_Hz, blocks, heard.lost, gap_s, device.answer_s, channels, problems, warnings
    )


def _listen(device: Device, frequency_Hz: float, seconds: float) -> _Heard:
    heard = _Heard()
    until_s, begun = time.monotonic() + seconds, False
    try:
        while time.monotonic() < until_s:
            device.write(frequency_Hz, 0.0)  # within its range, as a generator refuses another
            block = device.read()
            problems = device.problems()
            begun = begun or (block is not None and not block.waiting)  # not with blocks from before
            heard.dropped = problems[-1][1] if problems else heard.dropped
            if block is not None and (wrong := wrong_shape(block.samples, device.setup)):
                heard.failure = wrong
                break
            if block is not None and begun:
                heard.samples.append(block.samples)
                heard.at_s.append(time.monotonic())
                heard.lost += block.lost if len(heard.samples) > 1 else 0
            if device.pace == "computer":
                time.sleep(device.block_s)
    except Exception as error:  # an adapter may be foreign code
        heard.failure = reason_of(error)
    device.safe()
    return heard


def _rate(device: Device, heard: _Heard) -> tuple[float, float]:
    """Samples per second by the computer's clock, and the longest gap between two blocks [s]."""
    if device.pace != "device" or len(heard.at_s) < 2:
        return 0.0, 0.0
    blocks = len(heard.at_s) - 1 + heard.lost
    rate_Hz = blocks * device.setup.samples_per_block / (heard.at_s[-1] - heard.at_s[0])
    return rate_Hz, float(np.diff(heard.at_s).max())


def _of_device(device: Device, heard: _Heard, rate_Hz: float, gap_s: float) -> list[Problem]:
    problems: list[Problem] = []
    stated_Hz = device.setup.sample_rate_Hz
    if heard.failure:
        text, _, remedy = heard.failure.partition("; ")
        problems.append(Problem("device", text, remedy or "check its supply and its cable"))
    elif heard.dropped:
        problems.append(Problem("device", f"bad data: {heard.dropped}", "compare its frames with [converter]"))
    elif len(heard.samples) < 2:
        problems.append(Problem("device", "it sends no blocks", "check that it samples, and [device] of the rig file"))
    if rate_Hz and abs(rate_Hz / stated_Hz - 1.0) > _RATE:
        text = f"it makes {rate_Hz:.0f} samples a second, the rig file states {stated_Hz:.0f}"
        problems.append(Problem("device", text, f"set converter.sample_rate_Hz to {float(f'{rate_Hz:.4g}'):g}"))
    if heard.lost:
        problems.append(Problem("device", f"{heard.lost} blocks were lost", "lower its rate, or use a faster link"))
    if gap_s > _JITTER_BLOCKS * device.block_s:
        text = f"a block came {gap_s * 1e3:.0f} ms after the one before"
        problems.append(
            Problem("device", text, "end other programs, shorten the device's own buffer, or set TCP_NODELAY in it")
        )
    return problems


def _channel(rig: DeviceRig, name: str, raw: Floats) -> ChannelCheck:
    channel, nan = rig.channels[name], math.nan
    if channel.absent:
        return ChannelCheck(name, True, nan, nan, nan, nan, nan, 0.0)
    values = channel.sign * channel.scale * raw[rig.rows[name]] + channel.offset
    finite = values[np.isfinite(values)]
    missing = 1.0 - finite.size / max(values.size, 1)
    if finite.size < 2:
        return ChannelCheck(name, False, nan, nan, nan, nan, nan, missing)
    noise = float(np.sqrt(np.mean(np.diff(finite) ** 2) / 2.0))
    count = np.arange(finite.size)
    flat = (finite - np.polyval(np.polyfit(count, finite, 1), count)) * np.hanning(finite.size)
    spectrum = 4.0 * np.abs(np.fft.rfft(flat)) / finite.size
    bin_Hz = rig.converter.sample_rate_Hz / finite.size
    hum = max(_line(spectrum, bin_Hz, mains_Hz) for mains_Hz in _MAINS_HZ)
    return ChannelCheck(
        name, False, float(finite.min()), float(finite.mean()), float(finite.max()), noise, hum, missing
    )


def _line(spectrum: Floats, bin_Hz: float, tone_Hz: float) -> float:
    """Amplitude of a tone above the spectrum around it: slips have many frequencies, hum only its own."""
    off_Hz = np.abs(bin_Hz * np.arange(len(spectrum)) - tone_Hz)
    near = spectrum[off_Hz <= max(_MAINS_DRIFT_HZ, bin_Hz)].max(initial=0.0)
    around = (off_Hz >= max(2.0 * _MAINS_DRIFT_HZ, 3.0 * bin_Hz)) & (off_Hz <= max(_AROUND_HZ, 8.0 * bin_Hz))
    return max(float(near - spectrum[around].max(initial=0.0)), 0.0)


def _of_channel(rig: DeviceRig, row: ChannelCheck, raw: Floats) -> list[Problem]:
    known, channel = SENSOR_CHANNELS[row.name], rig.channels[row.name]
    problems: list[Problem] = []

    def add(text: str, remedy: str) -> None:
        problems.append(Problem(row.name, text, remedy))

    if row.missing:
        add(f"{100.0 * row.missing:.3g} % of its samples are missing", "check its plug and its place in the device")
    if not math.isfinite(row.mean):
        return problems
    if row.lowest == row.highest and known.sensor != "position":  # an encoder at rest repeats its number
        add(f"it stays at {row.mean:.4g}", "check its plug and source, or state absent = true")
        return problems
    if max(abs(row.lowest), abs(row.highest)) > known.largest:
        add(
            f"it reads up to {max(abs(row.lowest), abs(row.highest)):.3g}",
            "correct scale: the value must be in SI units",
        )
    for end, limit in ((row.lowest, channel.lowest), (row.highest, channel.highest)):
        if limit is not None and (end <= limit if limit == channel.lowest else end >= limit):
            add(f"it reaches the end of its range, {limit:g}", "use a larger range, or correct scale and offset")
    values = raw[rig.rows[row.name]]
    # the lowest position is often the one from which the slide moves, where it rested
    if known.sensor != "position" and np.unique(values[np.isfinite(values)]).size > _FEW_STEPS:
        share = max(float(np.mean(values == np.nanmin(values))), float(np.mean(values == np.nanmax(values))))
        if share > _AT_END:
            add(f"{100.0 * share:.3g} % of its samples are at one end", "the converter clips: use a larger range")
    if row.hum > _HUM * row.noise and known.sensor != "position":
        add(
            f"hum of {row.hum:.3g} above its noise of {row.noise:.3g}",
            "ground the shield at one end, away from the amplifier",
        )
    return problems
