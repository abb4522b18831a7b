"""Repeated blocks, latency, state of the rig, and steps of the controller, message by message; completeness of the log."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.arrays import Records
from bridge.log.check.log_check import LogWatch
from bridge.log.damage import Damage
from bridge.log.watches.arrays import Longest, steps
from bridge.log.watches.histogram import Histogram
from bridge.units import counted
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.channels import CHANNELS
from bridge.wire.messages import STALE
from bridge.wire.words import word_of
from cockpit.judge.setup import SETTLING_S, Setup

STANDSTILL_MPS = 2e-5  # a slower drive is at standstill; the default of the controller

_OF_EVERY_BLOCK = ("applied", "command", "trace")


class Latency(NamedTuple):
    """Latency from a block to its command."""

    p50_us: float  # the percentiles are accurate to 0.25 %
    p99_us: float
    p999_us: float
    within_1_ms: float  # share of the blocks whose command came within 1 ms
    answer_p50_us: float = 0.0  # the exciter's own answer time, part of the latency; 0 without one
    answer_p99_us: float = 0.0


class LatencyWatch:
    """Delays of the commands, recorded by the plant."""

    def __init__(self) -> None:
        self.took_us, self.answer_us = Histogram(), Histogram()
        self.sample_rate_Hz = 0.0  # as last measured; 0: not measured
        self.late = 0  # commands later than 1 ms
        self.blocks = self.commands = 0

    def add(self, records: Records) -> None:
        """Add rows of the rig, [blocks]."""
        self.blocks += len(records)
        self.commands += int(records["commands"].sum())
        self.late += int(records["commands_late"].sum())
        round_trip_ns = records["round_trip_ns"][records["commands"] > 0]
        self.took_us.add(round_trip_ns[round_trip_ns > 0] * 1e-3)
        self.answer_us.add(records["answer_ns"][records["answer_ns"] > 0] * 1e-3)
        measured_Hz = records["sample_rate_Hz"][records["sample_rate_Hz"] > 0.0]
        self.sample_rate_Hz = float(measured_Hz[-1]) if len(measured_Hz) else self.sample_rate_Hz

    def result(self) -> Latency | None:
        """Percentiles; None in lockstep, which has no latency."""
        if not self.took_us.count:
            return None
        # a missing command counts as late, except for the last block: its command arrives after the end of the log
        in_time = min((self.commands - self.late) / max(self.blocks - 1, 1), 1.0)
        p50_us, p99_us, p999_us = (self.took_us.quantile(share) for share in (0.5, 0.99, 0.999))
        return Latency(p50_us, p99_us, p999_us, in_time, self.answer_us.quantile(0.5), self.answer_us.quantile(0.99))


class RigWatch:
    """Whether commands reached the rig, whether its gain was verified, its present fault, and whether it disarmed itself."""

    def __init__(self) -> None:
        self.answered = False  # some block has a fresh command
        self.gain_seen = False  # a loop check confirmed the exciter's gain
        self.fault = ""  # cause of the FAULT in the latest row
        self.end_ns = 0  # time of the latest row
        self.checking = 0  # blocks of loop checks
        self._disarmed_s = np.inf  # first time at which the rig disarmed itself without a fresh command

    def add(self, records: Records) -> None:
        """Add rows of the rig, [blocks]."""
        self.answered |= bool((records["fallback"] == 0).any())
        self.gain_seen |= bool(np.isin(records["cause"], (wire.CHECK_PASSED, wire.GAIN_ACCEPTED)).any())
        self.checking += int((records["guard_state"] == wire.CHECKING).sum())
        self.end_ns = max(self.end_ns, int(records["t_ns"].max()))
        last = records[-1]
        self.fault = word_of("cause", int(last["cause"])) if last["guard_state"] == wire.FAULT else ""
        disarmed = (records["guard_state"] == wire.DISARMED) & (records["cause"] == wire.COMMAND_LOST)
        if disarmed.any():
            self._disarmed_s = min(self._disarmed_s, 1e-9 * float(records["t_ns"][disarmed.argmax()]))

    def disarmed(self) -> str:
        """Sentence with time and remedy if the rig disarmed itself for lack of fresh commands; else empty."""
        if self._disarmed_s == np.inf:
            return ""
        why = f"the rig disarmed itself at {self._disarmed_s:.2f} s, as no fresh command reached it"
        return f"{why}: look at the controller and the link to it, then `stickslip arm`"


class FrozenWatch:
    """Blocks equal to the block before, sample by sample: the driver of a stopped converter resends its last buffer."""

    def __init__(self) -> None:
        self.runs = {name: Longest() for name in CHANNELS}  # longest sequence of repeated blocks, by channel
        self._last: dict[str, npt.NDArray[np.float32]] = {}

    def add(self, records: Records) -> None:
        """Add sensor blocks, [blocks]."""
        for name, run in self.runs.items():
            values = np.concatenate([self._last.get(name, np.full_like(records[name][:1], np.nan)), records[name]])
            self._last[name] = values[-1:].copy()
            repeats = values[1:, 0] == values[:-1, 0]
            at = np.flatnonzero(repeats)
            # constant samples mean a dead channel, not a repeated block
            repeats[at] = (values[at + 1] == values[at]).all(axis=1) & (values[at] != values[at, :1]).any(axis=1)
            run.add(repeats)


class _Stretches:
    """First and last step of each stretch of steps with a property [s]."""

    def __init__(self) -> None:
        self._ended: list[tuple[float, float]] = []
        self._from_s: float | None = None
        self._last_s = 0.0

    def add(self, has: npt.NDArray[np.bool_], t_s: npt.NDArray[np.float64]) -> None:
        """Add steps, [steps]."""
        for at in np.flatnonzero(steps(has.view(np.int8), int(self._from_s is not None))):
            if has[at]:
                self._from_s = float(t_s[at])
            elif self._from_s is not None:
                self._ended.append((self._from_s, float(t_s[at - 1]) if at else self._last_s))
                self._from_s = None
        self._last_s = float(t_s[-1])

    def so_far(self, is_last: bool) -> list[tuple[float, float]]:
        """The stretches; an open one ends at the last step, or never while the log is still read."""
        if self._from_s is None:
            return self._ended
        return [*self._ended, (self._from_s, self._last_s if is_last else np.inf)]


class StepWatch:
    """Arming, missed blocks and stops, from the steps of the controller."""

    def __init__(self) -> None:
        self.steps = 0
        self.missed = 0  # blocks lost before the controller
        self.last_block = -1
        self.armed = self.moved = False
        self.highest_set_point = 0.0  # highest set point of v_a / v_d during vibration
        self.drive_velocity_max_mps = 0.0
        self.stale: list[tuple[float, float]] = []  # first and last step of each stretch without a timely block [s]
        self._idle, self._doubted = _Stretches(), _Stretches()

    def add(self, records: Records) -> None:
        """Add steps of the controller, [steps]."""
        self.steps += len(records)
        self.missed += int(records["gap_blocks"].sum())
        self.last_block = max(self.last_block, int(records["block"].max()))
        not_armed = records["reason"] == wire.NOT_ARMED
        self.armed = self.armed or not not_armed.all()
        v_d_mps, t_s = records["drive_velocity_mps"], records["t_ns"] * 1e-9
        self.moved = self.moved or bool((np.abs(v_d_mps) > STANDSTILL_MPS).any())
        self.drive_velocity_max_mps = max(self.drive_velocity_max_mps, float(v_d_mps.max()))
        set_points = records["velocity_ratio"][records["mode"] == wire.EXCITE]
        self.highest_set_point = max(self.highest_set_point, float(set_points.max(initial=0.0)))
        for at_s in t_s[(records["events"] & STALE) != 0].tolist():
            goes_on = self.stale and at_s - self.stale[-1][1] <= SETTLING_S
            self.stale[len(self.stale) - bool(goes_on) :] = [(self.stale[-1][0] if goes_on else at_s, at_s)]
        idle = (records["mode"] == wire.STOPPED) | not_armed
        self._idle.add(idle, t_s)
        frozen = (records["reason"] == wire.FROZEN) & ~np.isin(records["limit"], (wire.HELD_OPEN_LOOP, wire.NO_DRIVE))
        self._doubted.add(frozen | np.isin(records["reason"], (wire.FORCE_DOUBTED, wire.SLIDE_DOUBTED)), t_s)

    def stops(self, block_s: float, is_last: bool) -> list[tuple[float, float]]:
        """Stretches in which the controller is stopped or the rig not armed, each with its settling second [s]."""
        return [(from_s - block_s, last_s + SETTLING_S) for from_s, last_s in self._idle.so_far(is_last)]

    def doubted(self, is_last: bool) -> list[tuple[float, float]]:
        """Stretches in which the controller doubts the force or the slide position: their slips are not counted [s]."""
        return self._doubted.so_far(is_last)


class Losses(NamedTuple):
    """Losses of one log."""

    early: bool  # the log ends before the planned end of its run, without the plant's END
    blocks: int  # missing blocks
    at_the_end: int  # part of `blocks` after the last block in the log, by the plant's END
    blocks_known: bool  # False: a cut or damaged log may lack more
    messages: int  # missing messages, blocks included
    absent: list[str]  # topics without any message that should have one per block
    misses_known: bool  # False: the log lacks steps of the controller, so it may have missed more blocks


def losses_of(log: LogWatch, steps: StepWatch, setup: Setup, damage: Damage, seconds: float) -> Losses:
    """Losses of a log that ends at `seconds`.

    A damaged chunk may contain the first or the last blocks: then the number in the plant's END counts.
    """
    blocks, sent, topics = log.topics["sensors"], log.events.blocks_sent, log.topics
    early = seconds < setup.duration_s - 0.5 * setup.block_s and not log.events.has("plant", "END")
    at_the_end = max((sent or 0) - blocks.end, 0)
    lost, known = blocks.missing, damage.whole and not damage.before
    if sent is not None:  # by the plant's END also blocks before a late start of the recorder are counted
        lost, known = lost + (0 if known else blocks.first_number) + at_the_end, True
    return Losses(
        early=early,
        blocks=lost,
        at_the_end=at_the_end,
        blocks_known=known,
        messages=lost + sum(topics[name].missing for name in (*_OF_EVERY_BLOCK, "state")),
        absent=[name for name in _OF_EVERY_BLOCK if not (setup.imported or topics[name].messages)],
        # a gap is reported only by the step after it
        misses_known=topics["trace"].missing == 0 and steps.last_block >= max(blocks.end, sent or 0) - 1,
    )


def clock_fault(log: LogWatch) -> str:
    """Fault of the block times, in words; empty if the times follow the block numbers."""
    watch = log.topics["sensors"]
    if not watch.jumps:
        return ""
    number, where = (watch.standing, "is constant") if watch.standing > watch.jumps // 2 else (watch.jumps, "jumps")
    first, off_ns = watch.first_jump
    times = f"{where} at {counted(number, 'block')}, first {first} by {off_ns * 1e-6:g} ms: times are wrong from there"
    return f"CLOCK: t_ns of /sensors {times}"
