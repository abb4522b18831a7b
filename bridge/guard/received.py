"""Commands received by a rig's process: valid ones in order; all others are counted, reported and dropped."""

import collections

from bridge.faults import Fault
from bridge.wire.complaints import BAD_MESSAGE, FLOOD, FOREIGN, Complaints
from bridge.wire.inbox import WAITING
from bridge.wire.messages import COMMAND as COMMAND_LAYOUT
from bridge.wire.topics import COMMAND
from bridge.wire.zenoh_link import Received

# Commands above these values are dropped: no exciter of a machine reaches them. The guard limits smaller values.
_LARGEST_M = 1e-3
_HIGHEST_HZ = 1e6


class CommandQueue:
    """Queue between the receiving thread, which calls `push`, and the loop of the rig, which calls `take`.

    Args:
        complaints: reports the dropped commands.

    """

    def __init__(self, complaints: Complaints) -> None:
        self._complaints = complaints
        self._waiting: collections.deque[Received] = collections.deque(maxlen=WAITING)
        self._lost = self._reported = 0  # the first is written by the receiving thread alone
        self._newest = 0  # block answered by the newest command

    def push(self, received: Received) -> None:
        """Add a command."""
        self._lost += len(self._waiting) == WAITING  # the oldest drops out
        self._waiting.append(received)

    def take(self, block: int) -> list[tuple[Received, int]]:
        """The commands since the last call, each with the block that it answers.

        `block`: the number of the next block, which no command can answer yet.
        """
        commands: list[tuple[Received, int]] = []
        for _ in range(len(self._waiting)):
            received = self._waiting.popleft()
            answered = self.answered(received, block)
            if answered is not None:
                commands.append((received, answered))
        if lost := self._lost - self._reported:
            self._reported += lost
            self._complaints.note(FLOOD, COMMAND.name, "too many for one block: the oldest were dropped", lost)
        return commands

    def answered(self, received: Received, block: int) -> int | None:
        """The block that a command answers; None for a dropped command."""
        try:
            command = COMMAND_LAYOUT.read(received.payload, COMMAND.name)
        except Fault as fault:
            self._complaints.note(BAD_MESSAGE, COMMAND.name, f"{fault.line.partition(': ')[2]}: dropped")
            return None
        amplitude_m, frequency_Hz = float(command["amplitude_m"][0]), float(command["frequency_Hz"][0])
        answered = int(command["block"][0])
        if not (0.0 <= amplitude_m <= _LARGEST_M and 0.0 <= frequency_Hz <= _HIGHEST_HZ):
            text = f"{amplitude_m:g} m at {frequency_Hz:g} Hz is not a vibration: dropped"
            self._complaints.note(BAD_MESSAGE, f"{COMMAND.name} amplitude", text)
            return None
        if answered >= block:
            text = f"answers block {answered}, which is still to come after block {block - 1}: dropped"
            self._complaints.note(FOREIGN, f"{COMMAND.name} ahead", text)
            return None
        if answered < self._newest:
            text = f"answers block {answered}, after block {self._newest} was answered: dropped"
            self._complaints.note(FOREIGN, f"{COMMAND.name} behind", text)
            return None
        self._newest = answered
        return answered
