"""A rig behind its guard: commands in, sensor blocks and the applied vibration out, block by block."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import NamedTuple

from bridge.arrays import Records
from bridge.guard.check import gain_report
from bridge.guard.config import GuardConfig
from bridge.guard.states import apply_order
from bridge.kernel_cache import compile_once
from bridge.rig.faults.schedule import Faults
from bridge.rig.watch import Problem
from bridge.wire.messages import APPLIED as APPLIED_LAYOUT
from bridge.wire.messages import COMMAND as COMMAND_LAYOUT
from bridge.wire.messages import sealed, sensor_block
from bridge.wire.stickslip_pb2 import FAULT, STOP_BY_PERSON, STOP_KEPT
from bridge.wire.topics import APPLIED, COMMAND, SENSORS, Outgoing

LATE_NS = 1_000_000  # round trip beyond which a command counts as late


class GuardedNode(ABC):
    """A rig of any kind with its guard; a kind of rig adds the samples of a block.

    Args:
        guard: parameters and memory, records of `bridge.guard.records`.
        block_ns: length of a block by the rig's clock.
        samples: number of samples of a channel in a block.
        faults: injected faults.

    """

    kernels: str  # owner of its kernels, for the operator

    def __init__(self, guard: tuple[Records, Records], block_ns: int, samples: int, faults: Faults) -> None:
        self.block_ns = block_ns
        self._samples = samples
        self.faults = faults
        self.announcements: list[Outgoing] = []  # to be sent before the samples of the last block
        self._guard_params, self._guard_state = guard
        self._sensors = sensor_block(samples).blank()
        self._applied = APPLIED_LAYOUT.blank()
        self.applied = APPLIED_LAYOUT.row(self._applied)  # the applied vibration of the last block

    def warm_up(self) -> None:
        """Compile or load the kernels on copies, so that the first block is not late."""
        compile_once(self.kernels, self._step_copies)

    def advance(
        self, commands: list[bytes], commands_late: int = 0, round_trip_ns: int = 0, late_ns: int = 0
    ) -> tuple[Outgoing, ...]:
        """Advance one block under the newest of `commands` accepted by the guard; return sensor block and applied vibration.

        Send `announcements` before them. Without a block of the rig nothing is returned.

        Raises Fault BAD_MESSAGE if a command cannot be read, CONFIG if a simulated rig cannot be stepped.
        """
        faults, block = self.faults, self.block
        if faults.busy:
            faults.begin_block(block)
        payloads = b"".join(COMMAND_LAYOUT.canonical(payload, COMMAND.name) for payload in commands)
        accepted = self._act(COMMAND_LAYOUT.record(payloads))
        if accepted is None:
            return ()
        if faults.busy:
            faults.spoil(self._sensors, block)
        self._report(accepted, commands_late, round_trip_ns, late_ns)
        if faults.busy:
            faults.misdate((self._sensors, self._applied), block)
        return Outgoing(SENSORS, sealed(self._sensors.tobytes())), Outgoing(APPLIED, self._applied.tobytes())

    @abstractmethod
    def _step_copies(self) -> None:
        """Call every kernel of a block on copies."""

    @abstractmethod
    def _act(self, commands: Records) -> int | None:
        """Apply the commands and fill the samples of a block; the number of accepted commands, None without a block."""

    @abstractmethod
    def _report(self, accepted: int, commands_late: int, round_trip_ns: int, late_ns: int) -> None:
        """Pass the samples to the guard, and fill the guard's fields and the applied vibration."""

    @abstractmethod
    def let_go(self) -> None:
        """Drop all commands in force or delayed and enter DISARMED: the vibration fades to zero at the exciter's rate."""

    @property
    @abstractmethod
    def at_rest(self) -> bool:
        """Whether the base is at rest."""

    def problems(self) -> list[Problem]:
        """Codes, texts and numbers of new problems with the rig itself, which are reported once a second at most."""
        return []

    @property
    def paced_by_rig(self) -> bool:
        """Whether `advance` waits until the rig has a block."""
        return False

    @property
    def is_behind(self) -> bool:
        """Whether more blocks of the rig wait to be read."""
        return False

    def idle(self) -> None:
        """Discard the blocks before a run; call it at least each 0.2 s until the run begins."""
        return

    @abstractmethod
    def close(self) -> None:
        """Disconnect from the rig, which is at rest."""

    def apply_order(self, order: int) -> bool:
        """Apply an operator's order (`wire.Operator.Action`), HOLD or LEAVE. Returns whether it changed the state."""
        return bool(apply_order(self._guard_state[0], order))

    @property
    def block(self) -> int:
        """Number of the next block."""
        return int(self._guard_state["block"][0])

    @property
    def check_tones_Hz(self) -> list[float]:
        """Frequencies of the loop check."""
        p = self._guard_params[0]
        return [float(tone_Hz) for tone_Hz in p.tone_Hz[: int(p.tones)]]

    def accept_gain(self, gains: Sequence[float]) -> None:
        """Set the gains that later checks are compared with, one per tone, from an earlier run; empty: no comparison."""
        self._guard_state[0].accepted[: len(gains)] = gains

    def warm(self, heat_share: float) -> None:
        """Set the modelled warmth of the exciter from an earlier run, over the largest allowed."""
        self._guard_state["heat"] = heat_share

    @property
    def accepted_gain(self) -> list[float]:
        """The accepted exciter gain at each tone of the loop check; empty before the first check."""
        gains = [float(gain) for gain in self._guard_state[0].accepted[: int(self._guard_params[0].tones)]]
        return gains if all(gains) else []

    @property
    def gain_report(self) -> str:
        """The measured and the expected gain at each tone of the last loop check, as text."""
        return gain_report(self._guard_params[0], self._guard_state[0])

    @property
    def is_stopped(self) -> bool:
        """Whether the guard is in FAULT because of an operator's stop."""
        return self._guard_state["state"][0] == FAULT and self._guard_state["cause"][0] in (STOP_BY_PERSON, STOP_KEPT)


class Served(NamedTuple):
    """A rig that `bridge.rig.process.serve` serves."""

    name: str
    guard: GuardConfig
    notes: list[tuple[str, str]]  # codes and texts of events at the start: wide limits, lost protection
    make: Callable[[int, bool], GuardedNode]  # makes the node of a run number; whether it may start ARMED
