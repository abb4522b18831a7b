"""The figures of a run, and whether control is ok, not ok or not judged."""

from typing import Any, NamedTuple

from bridge.faults import FAULTS
from bridge.log.in_charge import WEAK_S, InCharge
from bridge.log.storage.chain import Chain
from bridge.units import counted
from bridge.wire.event_codes import EVENTS, TESTS, TRIPS, harms
from cockpit.judge.pauses import Computer, Pauses
from cockpit.judge.phases import Phase
from cockpit.judge.ratio_watch import RatioVerdict
from cockpit.judge.sensor_watch import SensorVerdict
from cockpit.judge.watches import Latency

OK, NOT_OK, NOT_JUDGED = "ok", "not ok", "not judged"
# Share of the judged blocks that may be missing. Larger: slips hide in a gap; smaller: one stall of the recorder, 80 ms in 8 s,
# leaves a run without a verdict.
MISSING_SHARE = 0.01
# of the events that harm: about the log and not about the rig
_OF_THE_LOG = {"GAP", "DROPPED", "LOG_WRITE", "LOG_LOST", "LOG_REPLACED"}
_OF_THE_RIG = {code for code in EVENTS if harms(code)} - _OF_THE_LOG
_TRIPS = {"FAULT", *TRIPS}


class RunVerdict(NamedTuple):
    """A run's figures."""

    log: str
    seconds: float
    planned_s: float  # of a run whose log ends before, and without the plant's END; 0 for any other
    blocks: int
    lost_blocks: int
    lost_messages: int  # at least: only the number of blocks is known for certain
    all_losses_known: bool  # False: a log that is cut or damaged may lack more than it shows
    absent: list[str]  # topics of every block that have no message in the log
    controller_missed: int  # blocks that never came to the controller, by its own count
    misses_known: bool  # False: the log lacks steps of the controller, which may have missed more blocks
    enabled_from_s: float
    stopped_s: float  # by an operator, and no part of `after`
    charge: InCharge  # when the rig was on its own, which is no part of `after` either, and blocks without an answer
    alone: Phase | None  # the rig on its own, for longer than a stall explains
    before: Phase | None
    taking_over: Phase | None  # the second that the controller has to settle, between `before` and `after`
    after: Phase | None
    unsure_slips: int  # of those in `after`: blocks are missing within them
    stopped_slips: int  # in `stopped_s` and the second after it, which are no part of `after` either
    stalled_slips: int  # in short fallbacks and the second after each, which are no part of `after` either
    drive_velocity_max_mps: float  # as measured
    velocity_ratio_min: float
    velocity_ratio_max: float
    ratio: RatioVerdict | None  # v_a over v_d, judged at both ends; None for an imported log
    highest_set_point: float  # of v_a over v_d while it vibrated: the controller raises it at the start and after slips
    sensors: SensorVerdict | None  # whether they can carry a verdict; None for an imported log
    latency: Latency | None
    late_commands: int  # that took more than 1 ms
    pauses: Pauses | None  # of every core of the computer; None in lockstep, and where they were not watched
    computer: Computer | None  # all stalls; None in lockstep
    not_watched: str  # why the computer's stalls are not known; empty where they are, and in lockstep
    faults: list[str]  # events and findings that harm the run, or its log
    told: list[str]  # other events
    chain: Chain
    normal_scheduling: list[str]  # processes without a real-time priority; in lockstep none needs it
    untested: str  # why nothing was tested; empty where the drive moved with the controller in charge
    doubts: list[str]  # why the run cannot be judged although something was tested
    imported: str  # the file of another program that the log was made from; empty for a run
    gain_verified: bool  # of the exciter: by a loop check of the rig, or by the configuration

    @property
    def control(self) -> str:
        """Whether the controller did its work: OK, NOT_OK or NOT_JUDGED."""
        return self._judged()[0]

    @property
    def reason(self) -> str:
        """Why it did not, or why that is not known; empty where it did."""
        return self._judged()[1]

    @property
    def cut(self) -> str:
        """Where the log ends, in words, if that is before the end of its run; else empty."""
        ends = f"the log ends at {self.seconds:.2f} s, the run was to end at {self.planned_s:.2f} s"
        return ends if self.planned_s and self.blocks else ""

    @property
    def good(self) -> bool:
        """Whether control is OK; of an imported log, which has no controller, whether it is whole."""
        if self.imported:
            return self.lost_blocks == 0 and not self.faults
        return self.control == OK

    @property
    def trips(self) -> list[str]:
        """Trips of the rig's guard, and doubts of the controller about a sensor or the exciter."""
        return [fault for fault in (*self.faults, *self.told) if _code(fault) in _TRIPS]

    @property
    def injected(self) -> list[str]:
        """Faults that a scenario or an operator asked for."""
        return [line for line in self.told if _code(line) in TESTS]

    @property
    def warnings(self) -> list[str]:
        """All other events and findings."""
        apart = {*self.trips, *self.injected}
        return [line for line in (*self.faults, *self.told) if line not in apart]

    def exit_status(self, strict: bool) -> int:
        """Of a command that judges: 0 ok, 1 not ok, 14 not judged; `strict`: 1 with any loss or late command, too."""
        if strict and self.losses():
            return 1
        if self.control == NOT_JUDGED and not self.imported:
            return FAULTS["NOT_JUDGED"].exit_status
        return 0 if self.good else 1

    def losses(self) -> list[str]:
        """Lost and late messages in words: an acceptance test allows none."""
        counts = (
            (self.lost_messages, "message lost in the log", "messages lost in the log"),
            (self.controller_missed, "block missed by the controller", "blocks missed by the controller"),
            (self.late_commands, "late command", "late commands"),
            (self.charge.unanswered, "block without a command", "blocks without a command"),
        )
        found = [f"no message of /{name} in the log" for name in self.absent]
        found += [counted(number, *names) for number, *names in counts if number]
        return [*found, *([] if self.all_losses_known else ["how many messages are lost is not known"])]

    def _judged(self) -> tuple[str, str]:
        if self.imported:
            return NOT_JUDGED, self.untested
        wrong = self._who_failed()
        if not wrong and (self.untested or self.after is None):
            return NOT_JUDGED, self.untested
        blind = self.blind
        if not blind:  # else the figures that the sensors show decide nothing
            wrong += self._figures_that_fail()
        if wrong:
            return NOT_OK, "; ".join(wrong)
        unsure = (
            [f"blocks are missing within {counted(self.unsure_slips, 'slip')}, which may be none"]
            if self.unsure_slips
            else []
        )
        cut = [f"{self.cut}; record the run again"] if self.cut else []
        absent = [f"no message of /{name} is in the log" for name in self.absent]
        doubts = [*cut, *blind, *absent, *self.doubts, *unsure]
        return (NOT_JUDGED, "; ".join(doubts)) if doubts else (OK, "")

    @property
    def blind(self) -> list[str]:
        """Findings on sensors on which the verdict rests."""
        findings = self.sensors.findings if self.sensors is not None else []
        return [f"{finding.code}: {finding.text}" for finding in findings if finding.decides]

    def _who_failed(self) -> list[str]:
        """Failures that need no sensor of the axis: a controller that was gone, trips, a vibration without effect."""
        if self.alone is not None:
            held_s = max(self.seconds - self.enabled_from_s - self.stopped_s - self.alone.seconds, 0.0)
            gone = ", then it was gone" if self.charge.controller_until_s is not None else ""
            return [f"the controller was in charge for {held_s:.2f} of {self.seconds:.2f} s only{gone}"]
        wrong = [fault for fault in self.faults if _code(fault) in _OF_THE_RIG]
        return [*wrong, *(name for name, seconds in self.charge.reasons_s.items() if seconds > WEAK_S)]

    def _figures_that_fail(self) -> list[str]:
        """Failures that the sensors show: slips, and far more vibration than is needed."""
        wrong: list[str] = []
        if self.after is not None and self.after.slips > self.unsure_slips:
            wrong.append(f"{counted(self.after.slips, 'slip')} with the controller in charge")
        if self.ratio is not None and not self.ratio.ok:
            wrong.append(f"v_a/v_d {self.ratio.in_words()}")
        return wrong

    def as_dict(self) -> dict[str, Any]:
        """For `--json`."""
        from cockpit.judge.verdict_words import data_in_words, headline

        table: dict[str, Any] = self._asdict() | {"good": self.good, "chain": self.chain.as_dict()}
        for name in ("before", "taking_over", "after", "alone"):
            table[name] = table[name] and table[name].as_dict()
        for name in ("charge", "latency", "pauses", "computer", "ratio"):
            table[name] = table[name] and table[name]._asdict()
        table["sensors"] = self.sensors and self.sensors.as_dict()
        more = {"headline": headline(self), "control": self.control, "reason": self.reason, "data": data_in_words(self)}
        return table | more | {"trips": self.trips, "injected": self.injected, "warnings": self.warnings}


def _code(line: str) -> str:
    """The code of an event with which a line begins."""
    return line.partition(":")[0]
