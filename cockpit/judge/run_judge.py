"""Judge of a run: takes messages piece by piece in the order of the log, and returns the verdict at the end.

It is composed of watches, each with a method for every topic that it reads, and of sums over windows. A watch of messages
goes into `_watches`, a sum over blocks and steps into `_judge_window`.
"""

import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from bridge.log.check.channel import not_finite
from bridge.log.check.log_check import LogWatch
from bridge.log.damage import Damage, damage_findings, foreign_in_words
from bridge.log.in_charge import GONE_S, InCharge
from bridge.log.metadata import Metadata, configuration_of
from bridge.log.storage.chain import HashChain, chain_findings
from bridge.units import counted
from bridge.wire import realtime
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.event_codes import WEAK_REASONS, harms, is_listed
from bridge.wire.messages import CHANNELS, Records
from cockpit.judge.described import described
from cockpit.judge.machine_terms import MotionOf
from cockpit.judge.pauses import CommandSum, StallSum
from cockpit.judge.phases import Phase, PhaseSum, Stretches, apart, together, within
from cockpit.judge.ratio_watch import RatioWatch
from cockpit.judge.sensor_watch import SensorWatch
from cockpit.judge.setup import SETTLING_S, Setup, is_known, setup_of
from cockpit.judge.slips import bins_of, forces_of
from cockpit.judge.tested import too_little, untested
from cockpit.judge.verdict import MISSING_SHARE, RunVerdict
from cockpit.judge.watches import FrozenWatch, LatencyWatch, StepWatch
from cockpit.judge.window import HasMoved, WaitingRows, reduced
from diagnosis.features.cycles import Cycles

if TYPE_CHECKING:
    from cockpit.judge.margins import Margins, MarginSum

_COUNTED_ELSEWHERE = {"NOT_FINITE", "DRIVE_UNSEEN", *WEAK_REASONS}  # counted from blocks and steps
_LETTER = re.compile(
    r"(^|: )[FCSM]: "
)  # of NAMUR NE 107, before the help of a cause; redundant in a line marked as trip or warning
_OF_EVERY_BLOCK = ("applied", "command", "trace")
_CONTROLLED = tuple(name for name in CHANNELS if name != "mass_accel_mps2")  # channels used by the controller


class RunJudge:
    """Judges one run.

    Args:
        path: of its log.
        headers: tables of the log, possibly filled during reading.
        margins: with the margins of the amplitude loop.
        stretch_from_s: begin of a further stretch to the end, with or without a controller.

    """

    def __init__(
        self,
        path: Path,
        headers: Metadata,
        margins: bool = False,
        stretch_from_s: float | None = None,
    ) -> None:
        self.log = LogWatch()
        self.cycles: Cycles | None = None  # all slips, after `result`; None without a force
        self.stretch: Phase | None = None  # the stretch from `stretch_from_s`, after `result`
        self._stretch_from_s = stretch_from_s
        self._path, self._headers = path, headers
        self._waiting = WaitingRows()
        self._latency, self._steps, self._frozen = LatencyWatch(), StepWatch(), FrozenWatch()
        self._watches: Sequence[Any] = (self._latency, self._frozen, self._steps)
        self._motion, self._moved = MotionOf(), HasMoved()
        self._commands, self._stalls = CommandSum(), StallSum()
        self._margins: MarginSum | None = None
        if margins:  # imported late: it loads the design of the controller
            from cockpit.judge import margins as of_loop

            self._margins = of_loop.MarginSum()
        self._sensor_watch: SensorWatch | None = None  # created, like `_ratio`, at the first window
        self._ratio: RatioWatch | None = None
        self._setup: Setup | None = None
        self._bins = 0
        self._first_ns: int | None = None
        self._last_ns = self._applied_ns = 0
        self._has_force = self._answered = False  # some block has a force; some block has a fresh command
        self._disarmed_s = np.inf  # first time at which the rig disarmed itself without a fresh command
        self._gain_seen = False  # a loop check confirmed the exciter's gain
        self._phases: dict[str, PhaseSum] = {}
        self._alone: dict[float, PhaseSum] = {}  # by begin [s]
        self._cycles: list[Cycles] = []

    def begin(self, headers: Metadata) -> None:
        """Set the tables of a log begun after the creation of the judge."""
        self._headers = headers

    def add(self, topic: str, records: Records, log_time_ns: npt.NDArray[np.int64]) -> None:
        """Add messages of a streaming topic, [messages]. Raises Fault BAD_LOG."""
        if not len(records):
            return
        self.log.add(topic, records, log_time_ns)
        for watch in self._watches:
            take: Callable[[Records], None] | None = getattr(watch, topic, None)
            if take is not None:
                take(records)
        if topic == "sensors":
            self._sensors(records)
        elif topic in ("trace", "applied") or (topic == "command" and self._margins is not None):
            self._waiting.others(topic, records)
        if topic == "applied":
            self._answered |= bool((records["fallback"] == 0).any())
            self._applied_ns = max(self._applied_ns, int(records["t_ns"].max()))
            self._gain_seen |= bool(np.isin(records["cause"], (wire.CHECK_PASSED, wire.GAIN_ACCEPTED)).any())
            left = (records["guard_state"] == wire.DISARMED) & (records["cause"] == wire.COMMAND_LOST)
            if left.any():
                self._disarmed_s = min(self._disarmed_s, 1e-9 * float(records["t_ns"][left.argmax()]))

    def add_others(self, topic: str, payloads: Sequence[bytes]) -> None:
        """Add messages of another topic."""
        self.log.add_others(topic, payloads)

    def _sensors(self, records: Records) -> None:
        if self._first_ns is None:
            self._first_ns = int(records["t_ns"].min())
            self._bins = bins_of(records["drive_force_N"].shape[1], self.log.period_ns)
        self._last_ns = int(records["t_ns"][-1])
        self._waiting.sensors(reduced(records, self._bins))
        if self._waiting.is_full(self.log.period_ns * 1e-9) and is_known(self._headers):
            self._judge_window(self._known_setup(), is_last=False)

    def _known_setup(self) -> Setup:
        if self._setup is None:
            self._setup = setup_of(self._headers, self._path, self.log.period_ns)
        return self._setup

    def _begin_phases(self, setup: Setup) -> None:
        """Create the stretches of the run; an imported log is all `before`."""
        began_s = max((self._first_ns or 0) * 1e-9 - setup.block_s, 0.0)  # the log may begin late
        if setup.imported:
            self._phases = {"before": PhaseSum(0.0, np.inf)}
            return
        enabled_s, settled_s = setup.enabled_from_s, setup.settled_from_s
        self._phases = {
            "before": PhaseSum(began_s, enabled_s),
            "taking_over": PhaseSum(enabled_s, settled_s),
            "after": PhaseSum(max(settled_s, began_s), np.inf),
        }
        plant = configuration_of(self._headers, "plant", self._path) if "plant" in self._headers else None
        of = described(plant, configuration_of(self._headers, "controller", self._path))
        self._sensor_watch = SensorWatch(of, self.log, self._frozen, setup.block_s)
        self._ratio = RatioWatch(setup)
        if self._stretch_from_s is not None:
            self._phases["stretch"] = PhaseSum(self._stretch_from_s, np.inf)

    def _judge_window(self, setup: Setup, is_last: bool) -> None:
        """Judge the pending blocks; all of them with `is_last`."""
        if not self._phases:
            self._begin_phases(setup)
        window = self._waiting.window(is_last, setup.block_s)
        forces = forces_of(window, setup, self._moved)
        window = window._replace(end=forces.end)
        motion = self._motion(window, setup.block_s) if not setup.imported else None
        if self._sensor_watch is not None and self._ratio is not None:
            self._sensor_watch.add(window, forces)
            self._ratio.add(window)
        for sum_ in (*self._phases.values(), *(self._alone.values() if is_last else ())):
            sum_.to_s = min(sum_.to_s, self._last_ns / 1e9) if is_last else sum_.to_s
        without = self._without(setup, is_last)
        for name, sum_ in self._phases.items():
            sum_.add(forces, motion, [] if name in ("before", "stretch") else without)
        for from_s, until_s in self._gone():
            alone = self._alone.setdefault(from_s, PhaseSum(from_s, until_s))
            alone.to_s = until_s
            alone.add(forces, motion, [])
        self._cycles.append(forces.cycles)
        self._has_force |= len(forces.t_s) > 0
        if not setup.imported:
            events = self.log.events
            self._commands.add(window, setup.block_s * 1e9, sorted(events.pauses), sorted(events.core_pauses))
            self._stalls.add(window, events.pauses)
            if self._margins is not None:
                self._margins.add(window)
        if not is_last:
            self._waiting.judged(window, forces.turned, forces.stroke, setup.block_s)

    def _fallbacks(self) -> Stretches:
        """Stretches without a fresh command; infinite end if still open."""
        charge = self.log.charge
        return [*charge.stretches, *([(charge.open_from_s, np.inf)] if charge.open_from_s is not None else [])]

    def _gone(self) -> Stretches:
        """Fallbacks too long for a stall."""
        return [stretch for stretch in self._fallbacks() if stretch[1] - stretch[0] > GONE_S]

    def _without(self, setup: Setup, is_last: bool) -> Stretches:
        """Stretches excluded from the judgement of the controller: stops, fallbacks and stalls, each with a settling second."""
        return [*self._steps.stops(setup.block_s, is_last), *_settling([*self._fallbacks(), *self._steps.stale])]

    def result(self, damage: Damage, chain: HashChain, foreign: dict[str, int]) -> RunVerdict:
        """Verdict at the end of the log. Raises Fault BAD_LOG."""
        charge = self.log.charge.result()
        setup = self._known_setup()
        if self._waiting.blocks:
            self._judge_window(setup, is_last=True)
        if self._has_force and "drive_force_N" not in setup.absent:
            self.cycles = Cycles(*(np.concatenate(parts) for parts in zip(*self._cycles, strict=True)))
        else:
            self._phases, self._alone = {}, {}
        phases = {name: sum_.result(setup.block_s) for name, sum_ in self._phases.items()}
        self.stretch = phases.get("stretch")
        after, seconds = phases.get("after"), self._last_ns / 1e9
        stops = self._steps.stops(setup.block_s, is_last=True)
        stopped_s = sum(min(until_s - SETTLING_S, seconds) - from_s for from_s, until_s in stops)
        gone, settled_s = self._gone(), setup.settled_from_s
        spans = ((max(from_s, settled_s), until_s, until_s - from_s) for from_s, until_s in self.log.charge.stretches)
        short = [(from_s, until_s) for from_s, until_s, length_s in spans if length_s <= GONE_S]
        short += [(from_s, until_s) for from_s, until_s in self._steps.stale if from_s > settled_s]
        enabled_s = min(setup.enabled_from_s, seconds) if setup.imported else setup.enabled_from_s
        in_charge_s = seconds - enabled_s - stopped_s - sum(until_s - from_s for from_s, until_s in gone)
        planned_s = self._planned_s(setup)
        lost_blocks, all_known = self._lost_blocks(damage)
        latency = self._latency.result()
        events = self.log.events
        not_watched = events.not_watched if latency is not None else ""
        faults, others = self._lines(charge, damage, chain, foreign)
        ratio = self._ratio.result() if self._ratio is not None else None
        watch = self._sensor_watch
        slips_s = self.cycles.breakaway_t_s if self.cycles is not None else np.empty(0)
        counted_s = apart((settled_s, seconds), self._without(setup, is_last=True))
        unreadable = damage.first_bad if damage.first_bad.startswith("/sensors") else ""
        why = untested(setup, self._steps, seconds, unreadable, self._answered, after, in_charge_s)
        disarmed = self._disarmed()
        return RunVerdict(
            log=str(self._path),
            seconds=seconds,
            planned_s=planned_s,
            blocks=self.log.topics["sensors"].messages,
            lost_blocks=lost_blocks,
            lost_messages=lost_blocks + sum(self.log.topics[name].missing for name in (*_OF_EVERY_BLOCK, "state")),
            all_losses_known=all_known and not planned_s,
            absent=[name for name in _OF_EVERY_BLOCK if not (setup.imported or self.log.topics[name].messages)],
            controller_missed=self._steps.missed,
            misses_known=self._misses_known(),
            enabled_from_s=enabled_s,
            stopped_s=stopped_s,
            charge=charge,
            alone=together(sum_.result(setup.block_s) for sum_ in self._alone.values()),
            before=phases.get("before"),
            taking_over=phases.get("taking_over"),
            after=after,
            unsure_slips=self._phases["after"].unsure if after is not None else 0,
            stopped_slips=self._slips_in(stops),
            stalled_slips=self._slips_in(_settling(short), [*stops, *_settling(gone)]),
            drive_velocity_max_mps=self._steps.drive_velocity_max_mps,
            velocity_ratio_min=ratio.lowest if ratio is not None else 0.0,
            velocity_ratio_max=ratio.highest if ratio is not None else 0.0,
            ratio=ratio,
            highest_set_point=self._steps.highest_set_point,
            sensors=watch.result(slips_s, counted_s) if watch is not None else None,
            latency=latency,
            late_commands=self._latency.late,
            pauses=self._commands.result(self._latency, sorted(events.pauses), self._applied_ns)
            if latency is not None and not not_watched
            else None,
            computer=self._stalls.result() if latency is not None else None,
            not_watched=not_watched,
            faults=faults,
            told=others,
            chain=chain,
            normal_scheduling=[
                event.source
                for event in events.kept
                if event.code == "START" and event.text.startswith(realtime.NORMAL)
            ],
            untested=f"{why}; {disarmed}" if why and disarmed else why,
            doubts=[]
            if setup.imported
            else self._doubts(charge, after, setup.block_s, chain, damage, all_known or planned_s > 0),
            imported=setup.imported,
            gain_verified=setup.known_gain or self._gain_seen,
        )

    def margins(self) -> "Margins":
        """Margins of the amplitude loop. Raises ValueError without `margins` at creation, Fault BAD_LOG."""
        if self._margins is None:
            raise ValueError("margins: must be requested at the creation of the judge")
        return self._margins.result(self._headers, self._path, self._steps.loop_delay_s)

    def _planned_s(self, setup: Setup) -> float:
        """Planned length if the log ends earlier and without the plant's END; else 0."""
        early = self._last_ns * 1e-9 < setup.duration_s - 0.5 * setup.block_s
        return setup.duration_s if early and not self.log.events.has("plant", "END") else 0.0

    def _slips_in(self, stretches: Stretches, without: Iterable[tuple[float, float]] = ()) -> int:
        """Number of slips inside any of the stretches and outside of `without`."""
        at_s = self.cycles.breakaway_t_s if self.cycles is not None else np.empty(0)
        return int(np.count_nonzero(within(at_s, stretches) & ~within(at_s, without)))

    def _lost_blocks(self, damage: Damage) -> tuple[int, bool]:
        """Number of blocks missing in the log, and whether it is exact.

        A damaged chunk may contain the first or the last blocks: then the number in the plant's END counts.
        """
        watch, whole = self.log.topics["sensors"], damage.whole and not damage.before
        if self.log.events.blocks_sent is None:
            return watch.missing, whole
        first = 0 if whole else watch.first_number  # the recorder may have started late
        return watch.missing + first + self._lost_at_the_end(), True

    def _lost_at_the_end(self) -> int:
        """Number of blocks after the last one in the log, by the plant's END."""
        return max((self.log.events.blocks_sent or 0) - self.log.topics["sensors"].end, 0)

    def _misses_known(self) -> bool:
        """True if the log has every step of the controller up to the last block; a gap is reported only by the step after it."""
        last = max(self.log.topics["sensors"].end, self.log.events.blocks_sent or 0) - 1
        return self.log.topics["trace"].missing == 0 and self._steps.last_block >= last

    def _lines(
        self, charge: InCharge, damage: Damage, chain: HashChain, foreign: dict[str, int]
    ) -> tuple[list[str], list[str]]:
        """Harmful events and findings, and the other ones; one line per code and source."""
        faults: list[str] = []
        others: list[str] = []
        counts, listed = self.log.events.counts, set[tuple[str, str]]()
        for event in self.log.events.kept:
            key = event.source, event.code
            if key in listed or event.code in _COUNTED_ELSEWHERE or not is_listed(event.code):
                continue
            listed.add(key)
            many = f" (the first of {counts[key]})" if counts[key] > 1 else ""
            text = _LETTER.sub(r"\1", self._open_loop(event) if event.code == "OPEN_LOOP" else event.text)
            (faults if harms(event.code) else others).append(f"{event.code}: {text}{many}")
        others += foreign_in_words(foreign)
        for code, text, is_fault in charge.sentences():
            (faults if is_fault else others).append(f"{code}: {text}")
        looks = {name: self.log.signals[name].result() for name in _CONTROLLED}
        gone = [finding for name, seen in looks.items() for finding in not_finite(name, seen, self.log.sample_s)]
        left_out = (f"NOT_FINITE: {finding.where}: {finding.text}; left out" for finding in gone)
        faults += [line for line in (self._clock(), *left_out, self._steps.unseen()) if line]
        findings = [*damage_findings(damage, self._path), *chain_findings(chain, self._path.name)]
        return [*faults, *(f"{finding.kind}: {finding.text}" for finding in findings)], others

    def _open_loop(self, event: wire.Event) -> str:
        """Text of the controller's trip. A preceding time without a fresh command explains the low v_a."""
        at_s = event.t_ns * 1e-9
        for from_s, until_s in self._fallbacks():
            if from_s <= at_s <= until_s + SETTLING_S:
                why = f"less v_a than commanded, as no fresh command reached the rig from {from_s:.2f} s on"
                return f"{why}: look at the link to the controller, then `stickslip reset`"
        return event.text

    def _disarmed(self) -> str:
        """Sentence if the rig disarmed itself; else empty."""
        if self._disarmed_s == np.inf:
            return ""
        why = f"the rig disarmed itself at {self._disarmed_s:.2f} s, as no fresh command reached it"
        return f"{why}: look at the controller and the link to it, then `stickslip arm`"

    def _clock(self) -> str:
        """Fault of the block times, in words; empty if the times follow the block numbers."""
        watch = self.log.topics["sensors"]
        if not watch.jumps:
            return ""
        constant = watch.standing > watch.jumps // 2
        how = (
            f"is constant at {counted(watch.standing, 'block')}"
            if constant
            else f"jumps at {counted(watch.jumps, 'block')}"
        )
        first, off_ns = watch.first_jump
        return f"CLOCK: t_ns of /sensors {how}, first {first} by {off_ns * 1e-6:g} ms: times are wrong from there"

    def _doubts(
        self, charge: InCharge, after: Phase | None, block_s: float, chain: HashChain, damage: Damage, all_known: bool
    ) -> list[str]:
        """Reasons against a verdict although something was tested."""
        doubts = [line for line in (self._clock(), self._disarmed(), too_little(after, self._phases, block_s)) if line]
        if charge.controller_until_s is not None:
            doubts.append(f"no step of the controller is in the log after {charge.controller_until_s:.2f} s")
        if after is not None:
            missing_s = block_s * (self._phases["after"].missing + self._lost_at_the_end())
            share = missing_s / (after.seconds + missing_s)
            if share > MISSING_SHARE:
                doubts.append(
                    f"{100 * share:.1f} % of the judged blocks are missing, more than {100 * MISSING_SHARE:g} %"
                )
        if chain.changes:
            doubts.append("bytes of the log were changed after it was written")
        if not all_known:
            kinds = [f"{finding.kind}: {finding.text}" for finding in damage_findings(damage, self._path)]
            doubts.append(f"the number of missing blocks is unknown; {'; '.join(kinds)}")
        return doubts


def _settling(stretches: Iterable[tuple[float, float]]) -> Stretches:
    """Stretches, each with the settling second after it."""
    return [(from_s, until_s + SETTLING_S) for from_s, until_s in stretches]
