"""Figures of a run, and the verdict on its control: ok, not ok or not judged."""

from typing import Final, Literal, NamedTuple

from bridge.faults import FAULTS
from bridge.log.in_charge import WEAK_S, InCharge
from bridge.log.storage.checksums import Checksums
from bridge.results import in_json
from bridge.units import counted
from bridge.wire.event_codes import EVENTS, TESTS, TRIPS, harms
from cockpit.judge.pauses import Computer, Pauses
from cockpit.judge.phases import Phase
from cockpit.judge.ratio_watch import RatioVerdict
from cockpit.judge.sensor_watch import SensorVerdict
from cockpit.judge.watches import Latency

OK: Final = "ok"
NOT_OK: Final = "not ok"
NOT_JUDGED: Final = "not judged"
Control = Literal["ok", "not ok", "not judged"]
# Allowed share of missing blocks in the judged time. Larger: slips hide in a gap. Smaller: one stall of the recorder, 80 ms in
# 8 s, leaves a run without a verdict.
MISSING_SHARE = 0.01
# Least share of the time asked for in which the controller was in charge. Smaller: a run without protection for longer is ok.
# Larger: a short stop by an operator leaves a run without a verdict.
IN_CHARGE_SHARE = 0.9
# harmful events that concern the log alone, not the rig
_OF_THE_LOG = {"DROPPED", "LOG_WRITE", "LOG_LOST", "LOG_REPLACED"}
_OF_THE_RIG = {code for code in EVENTS if harms(code)} - _OF_THE_LOG
_TRIPS = {"FAULT", *TRIPS}


class SampleRate(NamedTuple):
    """Rate of the samples."""

    measured_Hz: float  # by the clock of the rig's computer
    stated_Hz: float  # by the times of the blocks

    def in_words(self) -> str:
        """Both, and their ratio."""
        ratio = self.measured_Hz / self.stated_Hz
        return f"{self.measured_Hz:.1f} samples a second, measured: {ratio:.5f} times the stated {self.stated_Hz:.0f}"


class RunVerdict(NamedTuple):
    """Figures of a run."""

    log: str
    seconds: float
    planned_s: float  # planned length; 0: without an end, or unknown
    early: bool  # the log ends before the planned end of its run, without the plant's END
    blocks: int
    lost_blocks: int
    lost_messages: int  # lower limit: only the number of blocks is exact
    all_losses_known: bool  # False: a cut or damaged log may lack more
    absent: list[str]  # topics without any message that should have one per block
    controller_missed: int  # blocks lost before the controller, by its count
    misses_known: bool  # False: the log lacks steps of the controller, so it may have missed more blocks
    enabled_from_s: float
    stopped_s: float  # time for which the controller was stopped or the rig not armed; excluded from `after`
    charge: InCharge  # times without a controller, excluded from `after`, and blocks without an answer
    alone: Phase | None  # the rig without a controller, for longer than a stall explains
    before: Phase | None
    taking_over: Phase | None  # the settling second between `before` and `after`
    after: Phase | None
    unsure_slips: int  # slips in `after` during which blocks are missing, so they may not be slips
    stopped_slips: int  # slips in `stopped_s` and the second after it; excluded from `after`
    stalled_slips: int  # slips in short fallbacks and the second after each; excluded from `after`
    drive_velocity_max_mps: float  # largest v_d forwards that the controller measured
    velocity_ratio_min: float
    velocity_ratio_max: float
    ratio: RatioVerdict | None  # v_a over v_d against its lower and upper limit; None for an imported log
    highest_set_point: float  # highest set point of v_a / v_d: the controller raises it at the start and after slips
    sensors: SensorVerdict | None  # whether they can support a verdict; None for an imported log
    latency: Latency | None
    sample_rate: SampleRate | None  # None before 10 s, and for a rig that the computer paces
    late_commands: int  # commands later than 1 ms after their block
    pauses: Pauses | None  # simultaneous stalls of all cores; None in lockstep, or if not watched
    computer: Computer | None  # all stalls; None in lockstep
    not_watched: str  # reason for which stalls are unknown; else empty
    faults: list[str]  # harmful events and findings
    told: list[str]  # events and findings without harm
    checksums: Checksums
    normal_scheduling: list[str]  # processes without a real-time priority; irrelevant in lockstep
    untested: str  # reason for which the run does not test the controller; else empty
    doubts: list[str]  # reasons for which a run that tests the controller still gets no verdict
    imported: str  # source file of an imported log; empty for a run
    gain_verified: bool  # the exciter's gain was confirmed by a loop check, or is declared known in the configuration

    @in_json
    def headline(self) -> str:
        """The verdict in one sentence; for a cut log preceded by the time of its end."""
        from cockpit.judge.verdict_words import headline

        return headline(self)

    @in_json
    def data(self) -> str:
        """Completeness of the log in words, and whether the controller received the missing blocks."""
        from cockpit.judge.verdict_words import data_in_words

        return data_in_words(self)

    @in_json
    def control(self) -> Control:
        """Verdict on the controller: OK, NOT_OK or NOT_JUDGED."""
        return self._judged()[0]

    @in_json
    def reason(self) -> str:
        """Reason for NOT_OK or NOT_JUDGED; empty for OK."""
        return self._judged()[1]

    @property
    def cut(self) -> str:
        """Actual and planned end in words, if the log ends before the planned end of its run; else empty."""
        ends = f"the log ends at {self.seconds:.2f} s, the run was to end at {self.planned_s:.2f} s"
        return ends if self.early and self.blocks else ""

    @in_json
    def good(self) -> bool:
        """True if control is OK; for an imported log, which has no controller, if the log is complete."""
        if self.imported:
            return self.lost_blocks == 0 and not self.faults
        return self.control == OK

    @in_json
    def trips(self) -> list[str]:
        """Trips of the rig's guard, and doubts of the controller about a sensor or the exciter."""
        return [fault for fault in (*self.faults, *self.told) if _code(fault) in _TRIPS]

    @in_json
    def injected(self) -> list[str]:
        """Begins and ends of the faults that a scenario or an operator injected."""
        return [line for line in self.told if _code(line) in TESTS]

    @in_json
    def warnings(self) -> list[str]:
        """All other events and findings."""
        others = {*self.trips, *self.injected}
        return [line for line in (*self.faults, *self.told) if line not in others]

    def exit_status(self, strict: bool) -> int:
        """Exit status of a judging command: 0 ok, 1 not ok, 14 not judged; `strict`: also 1 for any loss or late command."""
        if strict and self.losses():
            return 1
        if self.control == NOT_JUDGED and not self.imported:
            return FAULTS["NOT_JUDGED"].exit_status
        return 0 if self.good else 1

    def losses(self) -> list[str]:
        """Lost and late messages in words, for acceptance tests."""
        counts = (
            (self.lost_messages, "message lost in the log", "messages lost in the log"),
            (self.controller_missed, "block missed by the controller", "blocks missed by the controller"),
            (self.late_commands, "late command", "late commands"),
            (self.charge.unanswered, "block without a command", "blocks without a command"),
        )
        losses = [f"no message of /{name} in the log" for name in self.absent]
        losses += [counted(number, *names) for number, *names in counts if number]
        return [*losses, *([] if self.all_losses_known else ["the number of lost messages is unknown"])]

    def _judged(self) -> tuple[Control, str]:
        if self.imported:
            return NOT_JUDGED, self.untested
        wrong = self._failures_without_sensors()
        if not wrong and (self.untested or self.after is None):
            return NOT_JUDGED, self.untested
        blind = self.blind
        if not blind:  # figures of a faulty sensor decide nothing
            wrong += self._failures_by_sensors()
        if wrong:
            return NOT_OK, "; ".join(wrong)
        doubts = [f"{self.cut}; record the run again"] if self.cut else []
        doubts += [*blind, *(f"no message of /{name} is in the log" for name in self.absent), *self.doubts]
        if self.unsure_slips:
            doubts.append(f"blocks are missing within {counted(self.unsure_slips, 'slip')}: they may not be slips")
        return (NOT_JUDGED, "; ".join(doubts)) if doubts else (OK, "")

    @property
    def blind(self) -> list[str]:
        """Findings on the sensors on which the verdict depends; with any, slips and v_a/v_d decide nothing."""
        findings = self.sensors.findings if self.sensors is not None else []
        return [f"{finding.code}: {finding.text}" for finding in findings if finding.decides]

    def _failures_without_sensors(self) -> list[str]:
        """Failures known without a sensor of the axis: absent controller, trips, ineffective vibration."""
        if self.alone is not None:
            held_s = max(self.seconds - self.enabled_from_s - self.stopped_s - self.alone.seconds, 0.0)
            end = ", then it was gone" if self.charge.controller_until_s is not None else ""
            return [f"the controller was in charge for {held_s:.2f} of {self.seconds:.2f} s only{end}"]
        wrong = [fault for fault in self.faults if _code(fault) in _OF_THE_RIG]
        return [*wrong, *(name for name, seconds in self.charge.reasons_s.items() if seconds > WEAK_S)]

    def _failures_by_sensors(self) -> list[str]:
        """Failures shown by the sensors: slips, and far too much vibration."""
        wrong: list[str] = []
        if self.after is not None and self.after.slips > self.unsure_slips:
            wrong.append(f"{counted(self.after.slips, 'slip')} with the controller in charge")
        if self.ratio is not None and not self.ratio.ok:
            wrong.append(f"OVER_EXCITED: v_a/v_d {self.ratio.in_words()}")
        return wrong


def _code(line: str) -> str:
    """Code of the event at the start of a line."""
    return line.partition(":")[0]
