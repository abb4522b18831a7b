"""Judge of a run: takes messages piece by piece in the order of the log, and returns the verdict at the end.

Watches, each with `add` for the messages of a topic, are in `_watches`; checks of windows are in `JudgedWindows`.
"""

import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from bridge.arrays import Floats, Records
from bridge.log.check.channel import not_finite
from bridge.log.check.log_check import LogWatch
from bridge.log.damage import CHANGED, Damage, damage_findings, foreign_in_words
from bridge.log.in_charge import InCharge
from bridge.log.metadata import Metadata, configuration_of
from bridge.log.storage.checksums import Checksums, checksum_findings
from bridge.wire import realtime
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.channels import SENSOR_CHANNELS
from bridge.wire.event_codes import SEVERITIES, TESTS, WEAK_REASONS, harms, is_listed
from bridge.wire.payloads import other_rig
from cockpit.judge.machine_terms import MotionOf
from cockpit.judge.pauses import CommandSum, StallSum
from cockpit.judge.phases import (
    Interruptions,
    Phase,
    PhaseSum,
    Stretches,
    apart,
    settling,
    too_little,
    untested,
    within,
)
from cockpit.judge.ratio_watch import RatioWatch
from cockpit.judge.sensor_watch import SensorWatch
from cockpit.judge.setup import SETTLING_S, Described, Setup, described, is_known, plant_of, setup_of
from cockpit.judge.slips import Forces, bins_of, forces_of
from cockpit.judge.verdict import IN_CHARGE_SHARE, MISSING_SHARE, RunVerdict, SampleRate
from cockpit.judge.watches import FrozenWatch, LatencyWatch, Losses, RigWatch, StepWatch, clock_fault, losses_of
from cockpit.judge.window import LAYOUTS, HasMoved, WaitingRows, Window, reduced
from diagnosis.slips import Cycles

# Events left out of the findings: the judge counts them from blocks and steps.
_COUNTED_ELSEWHERE = {"NOT_FINITE", *WEAK_REASONS}
# Severity before the text of a cause, a letter in older logs: removed, as each line is marked as trip or warning.
_SEVERITY = re.compile(rf"(^|: )({'|'.join([*filter(None, SEVERITIES), *SEVERITIES.values()])}): ")


class _Watch(Protocol):
    def add(self, records: Records) -> None: ...


class JudgedWindows:
    """Figures of one run, summed over its windows. `began_s`: begin of the first block; `stretch_from_s`: as in `RunJudge`."""

    def __init__(
        self,
        setup: Setup,
        of: Described,
        log: LogWatch,
        frozen: FrozenWatch,
        interruptions: Interruptions,
        began_s: float,
        stretch_from_s: float | None,
    ) -> None:
        self._setup, self._interruptions = setup, interruptions
        self._moved, self._motion = HasMoved(), MotionOf()
        self._cycles: list[Cycles] = []
        self._has_force = False  # some block of the log has a finite force
        self.checked = False  # the checks below have received a window; stays False for an imported log
        self.alone = PhaseSum(0.0, np.inf)  # stretches above 1 s, longer than a stall, without the controller
        self.phases = {
            "before": PhaseSum(began_s, setup.enabled_from_s),
            "taking_over": PhaseSum(setup.enabled_from_s, setup.settled_from_s),
            "after": PhaseSum(max(setup.settled_from_s, began_s), np.inf),
        }
        if stretch_from_s is not None:
            self.phases["stretch"] = PhaseSum(stretch_from_s, np.inf)
        self.ratio = RatioWatch(setup)
        self.commands, self.stalls = CommandSum(log.events, setup.block_s), StallSum(log.events)
        self.sensors = SensorWatch(of, log, frozen, setup.block_s)

    def add(self, window: Window, last_s: float) -> tuple[Window, Forces]:
        """Judge a window of a log read up to `last_s`. Returns the window with its final `end`, and its slips and forces."""
        block_s, is_last = self._setup.block_s, window.is_last
        forces = forces_of(window, self._setup, self._moved)
        window, motion = window._replace(end=forces.end), None
        if not self._setup.imported:
            self.checked = True
            motion = self._motion(window, block_s)
            self.sensors.add(window, forces)
            for check in (self.ratio, self.commands, self.stalls):
                check.add(window)
        without, doubted = self._interruptions.all(is_last), self._interruptions.doubted(is_last)
        for name, sum_ in self.phases.items():
            sum_.to_s = min(sum_.to_s, last_s) if is_last else sum_.to_s
            sum_.add(forces, motion, without if name in ("taking_over", "after") else [], doubted)
        if absences := self._interruptions.gone():
            self.alone.from_s, self.alone.to_s = absences[0][0], absences[-1][1]
            self.alone.add(forces, motion, apart((0.0, np.inf), absences), doubted)
        self._cycles.append(forces.cycles)
        self._has_force |= len(forces.t_s) > 0
        return window, forces

    def cycles(self) -> Cycles | None:
        """All slips of the run. Without a force it returns None and drops all stretches, as none can be judged."""
        if not self._has_force or "drive_force_N" in self._setup.absent:
            self.phases, self.alone = {}, PhaseSum(0.0, np.inf)
            return None
        return Cycles(*(np.concatenate(parts) for parts in zip(*self._cycles, strict=True)))


class RunJudge:
    """Judges one run.

    The configurations in `headers` may arrive while the log is read. `stretch_from_s` is the begin of a further stretch, judged
    up to the end of the run, whether or not a controller is in charge.
    """

    def __init__(self, path: Path, headers: Metadata, stretch_from_s: float | None = None) -> None:
        self.log = LogWatch()
        self.cycles: Cycles | None = None  # all slips, set by `result`; None without a force
        self.stretch: Phase | None = None  # the stretch from `stretch_from_s`, set by `result`
        self._stretch_from_s = stretch_from_s
        self._path, self._headers = path, headers
        self._latency, self._rig, self._steps, self._frozen = LatencyWatch(), RigWatch(), StepWatch(), FrozenWatch()
        self._watches: dict[str, list[_Watch]] = {
            "sensors": [self._frozen],
            "applied": [self._latency, self._rig],
            "trace": [self._steps],
        }
        self._waiting = WaitingRows()
        self._begun: tuple[Setup, Interruptions, JudgedWindows] | None = None
        self._bins = self._last_ns = 0
        self._first_ns: int | None = None

    def begin(self, headers: Metadata) -> None:
        """Set the configurations of a log that begins after this judge was created."""
        self._headers = headers

    def add(self, topic: str, records: Records, log_time_ns: npt.NDArray[np.int64]) -> None:
        """Add messages of a streaming topic, [messages]. Raises Fault BAD_LOG."""
        if not len(records):
            return
        self.log.add(topic, records, log_time_ns)
        for watch in self._watches.get(topic, ()):
            watch.add(records)
        if topic == "sensors":
            self._sensors(records)
        elif topic in LAYOUTS:
            self._waiting.others(topic, records)

    def add_others(self, topic: str, messages: Sequence[Any]) -> None:
        """Add messages of another topic."""
        self.log.add_others(topic, messages)

    def _sensors(self, records: Records) -> None:
        if self._first_ns is None:
            self._first_ns = int(records["t_ns"].min())
            self._bins = bins_of(records["drive_force_N"].shape[1], self.log.period_ns)
        self._last_ns = int(records["t_ns"][-1])
        self._waiting.sensors(reduced(records, self._bins))
        if self._waiting.is_full(self.log.period_ns * 1e-9) and is_known(self._headers):
            self._judge_window(is_last=False)

    def _begin(self) -> tuple[Setup, Interruptions, JudgedWindows]:
        """Setup, interruptions and windows of the run, created once its configurations are known."""
        if self._begun is None:
            setup = setup_of(self._headers, self._path, self.log.period_ns)
            controller = {} if setup.imported else configuration_of(self._headers, "controller", self._path)
            of = described(plant_of(self._headers, self._path), controller)
            began_s = max((self._first_ns or 0) * 1e-9 - setup.block_s, 0.0)  # the log may begin late
            gaps = Interruptions(setup, self.log.charge, self._steps)
            windows = JudgedWindows(setup, of, self.log, self._frozen, gaps, began_s, self._stretch_from_s)
            self._begun = setup, gaps, windows
        return self._begun

    def _judge_window(self, is_last: bool) -> None:
        """Judge the pending blocks; all of them with `is_last`."""
        setup, _, windows = self._begin()
        window, forces = windows.add(self._waiting.window(is_last, setup.block_s), self._last_ns / 1e9)
        if not is_last:
            self._waiting.judged(window, forces.turned, forces.stroke, setup.block_s)

    def result(self, damage: Damage, checksums: Checksums, foreign: dict[str, int]) -> RunVerdict:
        """Verdict at the end of the log. Raises Fault BAD_LOG."""
        charge = self.log.charge.result()
        setup, gaps, windows = self._begin()
        if self._waiting.blocks:
            self._judge_window(is_last=True)
        self.cycles = windows.cycles()
        block_s, seconds, events, steps = setup.block_s, self._last_ns / 1e9, self.log.events, self._steps
        phases = {name: sum_.result(block_s) for name, sum_ in windows.phases.items()}
        self.stretch = phases.get("stretch")
        after = phases.get("after")
        stops, absences = gaps.stops(is_last=True), gaps.gone()
        stopped_s = sum(min(until_s - SETTLING_S, seconds) - from_s for from_s, until_s in stops)
        enabled_s = min(setup.enabled_from_s, seconds) if setup.imported else setup.enabled_from_s
        in_charge_s = seconds - enabled_s - stopped_s - sum(until_s - from_s for from_s, until_s in absences)
        losses = losses_of(self.log, steps, setup, damage, seconds)
        latency = self._latency.result()
        not_watched = events.not_watched if latency is not None else ""
        damaged = [f"{finding.kind}: {finding.text}" for finding in damage_findings(damage, self._path)]
        faults, others = self._lines(charge, gaps.fallbacks(), damaged, checksums, foreign)
        named = (self._headers.get(role, {}).get("rig", "") for role in ("plant", "controller"))
        others += [*windows.sensors.other_stiffness(setup.stiffness_N_per_m), *filter(None, [other_rig(*named)])]
        ratio = windows.ratio.result() if windows.checked else None
        slips_s = self.cycles.breakaway_t_s if self.cycles is not None else np.empty(0)
        judged_s = apart((setup.settled_from_s, seconds), gaps.all(is_last=True))
        unreadable = damage.first_bad if damage.first_bad.startswith("/sensors") else ""
        why = untested(setup, steps, seconds, unreadable, self._rig, after, in_charge_s)
        disarmed = self._rig.disarmed()
        return RunVerdict(
            log=str(self._path),
            seconds=seconds,
            planned_s=setup.duration_s,
            early=losses.early,
            blocks=self.log.topics["sensors"].messages,
            lost_blocks=losses.blocks,
            lost_messages=losses.messages,
            all_losses_known=losses.blocks_known and not losses.early,
            absent=losses.absent,
            controller_missed=steps.missed,
            misses_known=losses.misses_known,
            enabled_from_s=enabled_s,
            stopped_s=stopped_s,
            charge=charge,
            alone=windows.alone.result(block_s),
            before=phases.get("before"),
            taking_over=phases.get("taking_over"),
            after=after,
            unsure_slips=windows.phases["after"].unsure if after is not None else 0,
            stopped_slips=_slips_in(slips_s, stops),
            stalled_slips=_slips_in(slips_s, gaps.stalls(), [*stops, *settling(absences)]),
            drive_velocity_max_mps=steps.drive_velocity_max_mps,
            velocity_ratio_min=ratio.lowest if ratio is not None else 0.0,
            velocity_ratio_max=ratio.highest if ratio is not None else 0.0,
            ratio=ratio,
            highest_set_point=steps.highest_set_point,
            sensors=windows.sensors.result(slips_s, judged_s) if windows.checked else None,
            latency=latency,
            sample_rate=self._sample_rate(),
            late_commands=self._latency.late,
            pauses=windows.commands.result(self._latency, self._rig.end_ns)
            if latency is not None and not not_watched
            else None,
            computer=windows.stalls.result() if latency is not None else None,
            not_watched=not_watched,
            faults=faults,
            told=others,
            checksums=checksums,
            normal_scheduling=[
                event.source
                for event in events.kept
                if event.code == "START" and event.text.startswith(realtime.NORMAL)
            ],
            untested=f"{why}; {disarmed}" if why and disarmed else why,
            doubts=[] if setup.imported else self._doubts(charge, after, losses, checksums, damaged),
            imported=setup.imported,
            gain_verified=setup.known_gain or self._rig.gain_seen,
        )

    def _sample_rate(self) -> SampleRate | None:
        measured_Hz = self._latency.sample_rate_Hz
        return SampleRate(measured_Hz, 1.0 / self.log.sample_s) if measured_Hz else None

    def _lines(
        self, charge: InCharge, fallbacks: Stretches, damaged: list[str], checksums: Checksums, foreign: dict[str, int]
    ) -> tuple[list[str], list[str]]:
        """Harmful events and findings, and the other ones; one line per code and source."""
        faults: list[str] = []
        others: list[str] = []
        counts, listed = self.log.events.counts, set[tuple[str, str]]()
        for event in self.log.events.kept:
            key = event.source, event.code
            if event.code in TESTS:  # each of them is another fault
                others.append(f"{event.code}: {event.text}, at {event.t_ns * 1e-9:.2f} s")
                continue
            if key in listed or event.code in _COUNTED_ELSEWHERE or not is_listed(event.code):
                continue
            listed.add(key)
            many = f" (the first of {counts[key]})" if counts[key] > 1 else ""
            text = _SEVERITY.sub(r"\1", _open_loop(event, fallbacks) if event.code == "OPEN_LOOP" else event.text)
            (faults if harms(event.code) else others).append(f"{event.code}: {text}{many}")
        others += foreign_in_words(foreign)
        for code, text, is_fault in charge.sentences():
            (faults if is_fault else others).append(f"{code}: {text}")
        channels = {name: self.log.signals[name].result() for name, row in SENSOR_CHANNELS.items() if row.is_controlled}
        gaps = [finding for name, seen in channels.items() for finding in not_finite(name, seen, self.log.sample_s)]
        faults += [clock] if (clock := clock_fault(self.log)) else []
        faults += [f"NOT_FINITE: {finding.where}: {finding.text}; left out" for finding in gaps]
        changed = [f"{finding.kind}: {finding.text}" for finding in checksum_findings(checksums, self._path)]
        return [*faults, *damaged, *changed], others

    def _doubts(
        self, charge: InCharge, after: Phase | None, losses: Losses, checksums: Checksums, damaged: list[str]
    ) -> list[str]:
        """Reasons for which a run that tests the controller still gets no verdict."""
        setup, gaps, windows = self._begin()
        doubts = [clock_fault(self.log), self._rig.disarmed(), too_little(after, windows.phases, setup.block_s)]
        doubts.append(self._too_seldom(setup, gaps.stops(is_last=True)))
        if charge.controller_until_s is not None:
            doubts.append(f"no step of the controller is in the log after {charge.controller_until_s:.2f} s")
        if after is not None:
            missing_s = setup.block_s * (windows.phases["after"].missing + losses.at_the_end)
            share = missing_s / (after.seconds + missing_s)
            if share > MISSING_SHARE:
                most = f"more than {100 * MISSING_SHARE:g} %"
                doubts.append(f"{100 * share:.1f} % of the judged blocks are missing, {most}")
        if checksums.changed or any(CHANGED in line for line in damaged):
            doubts.append("bytes of the log were changed after it was written or judged")
        if not (losses.blocks_known or losses.early):
            doubts.append(f"the number of missing blocks is unknown; {'; '.join(damaged)}")
        return [doubt for doubt in doubts if doubt]

    def _too_seldom(self, setup: Setup, stops: Stretches) -> str:
        """Reason for which the controller was not in charge for long enough, loop checks and stalls aside; else empty."""
        end_s = self._last_ns * 1e-9
        asked_s = max(end_s - setup.enabled_from_s, 0.0)
        idle_s = sum(
            max(min(until_s - SETTLING_S, end_s) - max(from_s, setup.enabled_from_s), 0.0) for from_s, until_s in stops
        )
        without_s = max(idle_s - setup.block_s * self._rig.checking, 0.0)
        if without_s <= (1.0 - IN_CHARGE_SHARE) * asked_s:
            return ""
        line = f"the controller was stopped, or the rig not armed, for {without_s:.2f} of {asked_s:.2f} s"
        return f"{line}, more than {100 * (1 - IN_CHARGE_SHARE):.0f} %: make the run longer, or keep the rig armed"


def _slips_in(slips_s: Floats, stretches: Stretches, without: Iterable[tuple[float, float]] = ()) -> int:
    """Number of slips inside any of the stretches and outside of the stretches `without`."""
    return int(np.count_nonzero(within(slips_s, stretches) & ~within(slips_s, without)))


def _open_loop(event: wire.Event, fallbacks: Stretches) -> str:
    """Text of an OPEN_LOOP event. If no fresh command reached the rig just before, it names that as the cause of the low v_a."""
    at_s = event.t_ns * 1e-9
    for from_s, until_s in fallbacks:
        if from_s <= at_s <= until_s + SETTLING_S:
            why = f"less v_a than commanded, as no fresh command reached the rig from {from_s:.2f} s on"
            return f"{why}: look at the link to the controller, then `stickslip reset`"
    return event.text
