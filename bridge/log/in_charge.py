"""Who was in charge of the rig, block by block: fallback, missing commands, a controller that left, a weak exciter."""

from typing import NamedTuple

import numpy as np

from bridge.arrays import Records
from bridge.log.finding import Finding
from bridge.log.watches.arrays import median, steps
from bridge.units import counted
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.event_codes import WEAK_REASONS
from bridge.wire.messages import NO_BLOCK
from bridge.wire.words import help_of

# A longer fallback means that the controller is absent, not stalled. Smaller: a controller that stalls for 0.5 s counts as
# absent. Larger: slips without a controller count as slips in a stall. The bus drops a frozen process after its lease, 1.5 s.
GONE_S = 1.0
UNANSWERED_SHARE = 0.01  # largest share of blocks without an answer that is not a fault; every busy desktop has some
WEAK_S = 1.0  # longest total time of ineffective vibration for one reason that is not a fault
_MOST_STRETCHES = 1000  # most stretches that a result lists; the total time includes all


class InCharge(NamedTuple):
    """Time with and without a controller in charge, over a whole log."""

    fallback_s: float  # time in which the rig had no fresh command
    fallbacks: int  # number of stretches without a fresh command
    longest_fallback_s: float
    stretches: list[tuple[float, float]]  # from and until [s of the run], at most 1000
    unanswered: int  # blocks that no command answers, fallback included
    answerable: int  # blocks that a command could answer: from the first answered block on
    controller_until_s: float | None  # last step of a controller that left before the end; None: it stayed
    reasons_s: dict[str, float]  # time of each reason for ineffective vibration

    @property
    def alone(self) -> bool:
        """Whether the rig was without a controller for longer than late commands explain."""
        return self.longest_fallback_s > GONE_S or self.controller_until_s is not None

    def sentences(self) -> list[tuple[str, str, bool]]:
        """Code, text and whether it is a fault, for each event that an operator should know."""
        rows: list[tuple[str, str, bool]] = []
        if self.fallbacks:
            where = f", first from {self.stretches[0][0]:.2f} s on" if self.stretches else ""
            text = (
                f"the rig was without a fresh command for {self.fallback_s:.2f} s, {counted(self.fallbacks, 'time')}{where}, "
                f"the longest {self.longest_fallback_s:.2f} s: no controller was in charge then"
            )
            rows.append(("FALLBACK", text, self.longest_fallback_s > GONE_S))
        if self.controller_until_s is not None:
            text = f"the controller's last step was at {self.controller_until_s:.2f} s, and the rig went on without it"
            rows.append(("CONTROLLER_LOST", text, True))
        if self.unanswered:
            share = self.unanswered / max(self.answerable, 1)
            text = f"{counted(self.unanswered, 'block')} of {self.answerable} have no command that answers them"
            rows.append(("UNANSWERED", text, share > UNANSWERED_SHARE))
        for name, seconds in self.reasons_s.items():
            rows.append((name, f"for {seconds:.2f} s: {help_of('reason', name)}", seconds > WEAK_S))
        return rows

    def findings(self) -> list[Finding]:
        """A finding for each fault."""
        return [
            Finding(code.lower().replace("_", "-"), "/trace" if code in self.reasons_s else "/applied", text)
            for code, text, is_fault in self.sentences()
            if is_fault
        ]


class ChargeWatch:
    """Collects the times of one log, piece by piece, in file order; the memory does not grow with the log."""

    def __init__(self) -> None:
        self.stretches: list[tuple[float, float]] = []  # ended fallbacks: from and until [s of the run]
        self._fallbacks = 0
        self._fallback_ns = self._longest_ns = 0
        self._since_ns: int | None = None  # begin of the present fallback
        self._leaving = False  # in the present fallback no command is in force: the rig ends its run
        self._commanded = False  # the rig has had a command
        self._block_ns = 0
        self._end_ns = self._last_block = 0
        self._first_answered: int | None = None
        self._newest_answered = -1
        self._answered = 0
        self._steps_until_ns: int | None = None
        self._lost_commands = 0
        self._next_command: int | None = None
        self._reasons = dict.fromkeys(map(wire.Reason.Value, WEAK_REASONS), 0)

    def applied(self, records: Records) -> None:
        """Add messages of /applied, [blocks]: they show fallback and the command in force."""
        if not len(records):
            return
        t_ns = records["t_ns"].astype(np.int64)
        if not self._block_ns:
            self._block_ns = int(median(np.diff(t_ns))) if len(t_ns) > 1 else int(t_ns[0])
        fallback = records["fallback"] != 0
        without = records["command_block"] == np.uint64(NO_BLOCK)
        edges = np.flatnonzero(steps(fallback.view(np.int8), int(self._since_ns is not None)))
        for at in edges:
            if fallback[at]:
                self._since_ns = int(t_ns[at]) - self._block_ns
            elif self._since_ns is not None:
                self._end(int(t_ns[at]) - self._block_ns)
        self._commanded = self._commanded or bool((~without).any())
        self._leaving = bool(fallback[-1] and without[-1] and self._commanded)
        self._end_ns = int(t_ns[-1])
        self._last_block = int(records["sequence"][-1])

    def _end(self, until_ns: int) -> None:
        since_ns, self._since_ns = self._since_ns or 0, None
        length_ns = until_ns - since_ns
        if since_ns <= 0 and length_ns <= GONE_S * 1e9:
            return  # the first block of every run comes before its first command
        self._fallbacks += 1
        self._fallback_ns += length_ns
        self._longest_ns = max(self._longest_ns, length_ns)
        self.stretches.append((since_ns * 1e-9, until_ns * 1e-9))

    @property
    def open_from_s(self) -> float | None:
        """Begin of the present fallback [s]; None without a fallback, or while the rig ends its run."""
        return self._since_ns * 1e-9 if self._since_ns is not None and not self._leaving else None

    def command(self, records: Records) -> None:
        """Add messages of /command, [messages]: they show the answered blocks."""
        if not len(records):
            return
        numbers = records["sequence"].astype(np.int64)
        blocks = records["block"].astype(np.uint64).astype(np.int64)
        if self._first_answered is None:
            self._first_answered = int(blocks[0])
            self._newest_answered = int(blocks[0]) - 1
        newest = np.maximum.accumulate(np.concatenate([[self._newest_answered], blocks]))
        self._answered += int(np.count_nonzero(np.diff(newest) > 0))
        self._newest_answered = int(newest[-1])
        step = steps(numbers, int(numbers[0]) - 1 if self._next_command is None else self._next_command - 1)
        self._lost_commands += int((step[step > 1] - 1).sum())
        self._next_command = int(numbers[-1]) + 1

    def trace(self, records: Records) -> None:
        """Add messages of /trace, [steps]: they show the controller's last step and its reasons."""
        if not len(records):
            return
        self._steps_until_ns = max(self._steps_until_ns or 0, int(records["t_ns"].max()))
        for reason in self._reasons:
            self._reasons[reason] += int(np.count_nonzero(records["reason"] == reason))

    def result(self) -> InCharge:
        """The times of the whole log, at its end."""
        if self._since_ns is not None and not self._leaving:
            self._end(self._end_ns)
        first = self._first_answered
        # the command that answers the last block comes after the rig's end
        answerable = max(self._last_block - first, 0) if first is not None else 0
        unanswered = max(answerable - self._answered - self._lost_commands, 0)
        until_ns = self._steps_until_ns
        left = until_ns is not None and self._end_ns - until_ns > GONE_S * 1e9
        block_s = self._block_ns * 1e-9
        return InCharge(
            fallback_s=self._fallback_ns * 1e-9,
            fallbacks=self._fallbacks,
            longest_fallback_s=self._longest_ns * 1e-9,
            stretches=self.stretches[:_MOST_STRETCHES],
            unanswered=unanswered,
            answerable=answerable,
            controller_until_s=until_ns * 1e-9 if left and until_ns is not None else None,
            reasons_s={wire.Reason.Name(reason): count * block_s for reason, count in self._reasons.items() if count},
        )
