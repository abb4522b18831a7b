"""The bus in one direction, with faults: drops, delays and changes messages, block by block."""

import heapq
from typing import Any, NamedTuple

import numpy as np

from bridge.rig.faults.table import FaultTable
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import sealed, sensor_block
from bridge.wire.topics import SENSORS

_CORRUPTED_BYTES = 3  # changed bytes of a corrupted message
_FOREIGN_RUN = 666  # run number of a forged command
_MOST_WAITING = 20_000  # most messages under way in one direction: 20 s of blocks of 1 ms


class Message(NamedTuple):
    """The bytes of a message under way, and the object they belong to."""

    payload: bytes
    of: Any = None


class Line:
    """One direction: `send` takes the messages of a block, `arrive` returns the messages that are due.

    Args:
        block_s: length of a block, in which times are counted.
        commands: whether this is the direction of the commands.

    """

    def __init__(self, block_s: float, commands: bool) -> None:
        self._block_s = block_s
        self._commands = commands
        self._waiting: list[tuple[float, int, Message]] = []
        self._sent = 0

    @property
    def empty(self) -> bool:
        """Whether no message is under way."""
        return not self._waiting

    def send(self, message: Message, block: int, faults: list[tuple[FaultTable, int, np.random.Generator]]) -> None:
        """Send a message in a block.

        Args:
            message: the message.
            block: number of the block.
            faults: the acting faults, each with its last block and its random numbers.

        """
        due, copies, more = float(block), [message], []
        for table, until, random in faults:
            size = table.size
            if table.kind == "cut" or (table.kind == "dropped" and random.random() < size):
                copies = []
            elif table.kind == "repeated":
                copies = copies * (1 + round(size))
            elif table.kind == "late":
                due += round(size / self._block_s)
            elif table.kind == "jittered":
                due += random.random() * size / self._block_s
            elif table.kind == "reordered":
                due += 1.5 * (self._sent % 2)  # after the next message, which follows a block later
            elif table.kind == "held":
                due = max(due, float(until))
            elif table.kind == "corrupted" and random.random() < size:
                copies = [Message(_corrupted(copy.payload, random), copy.of) for copy in copies]
            elif table.kind == "truncated" and random.random() < size:
                copies = [copy._replace(payload=copy.payload[: random.integers(len(copy.payload))]) for copy in copies]
            elif table.kind == "forged":
                more = [Message(self._forged(message.payload), message.of)] * round(size)
        for copy in (*copies, *more):
            if len(self._waiting) < _MOST_WAITING:
                heapq.heappush(self._waiting, (due, self._sent, copy))
                self._sent += 1

    def arrive(self, block: int) -> list[Message]:
        """The messages that arrive in a block, in order of arrival."""
        arrived: list[Message] = []
        while self._waiting and self._waiting[0][0] < block + 1:
            arrived.append(heapq.heappop(self._waiting)[2])
        return arrived

    def _forged(self, payload: bytes) -> bytes:
        if self._commands:
            command = wire.Command.FromString(payload)
            command.run, command.amplitude_m, command.frequency_Hz = _FOREIGN_RUN, 1e-7, 4500.0
            return command.SerializeToString()
        block = wire.SensorBlock.FromString(payload)
        block.sequence += 1 << 40
        layout = sensor_block(len(block.drive_force_N))
        return sealed(layout.canonical(block.SerializeToString(), SENSORS.name))


def _corrupted(payload: bytes, random: np.random.Generator) -> bytes:
    """A copy of the message with changed bytes; every second copy, at random, is also cut in half."""
    spoiled = bytearray(payload)
    for at in random.integers(0, len(spoiled), _CORRUPTED_BYTES):
        spoiled[at] ^= int(random.integers(1, 256))
    return bytes(spoiled[: len(spoiled) // 2] if random.random() < 0.5 else spoiled)
