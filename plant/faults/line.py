"""The bus in one direction, with faults: what becomes of the messages on their way, block by block."""

import heapq
from typing import Any, NamedTuple

import numpy as np

from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import sealed, sensor_block
from bridge.wire.topics import SENSORS
from plant.faults.table import FaultTable

_CORRUPTED_BYTES = 3
_FOREIGN_RUN = 666  # of a command that nobody of the run sent
_MOST_WAITING = 20_000  # messages; ten seconds of two directions


class Message(NamedTuple):
    """Bytes on their way, and what belongs to them."""

    payload: bytes
    of: Any = None


class Line:
    """One direction: `send` takes the messages of a block, `arrive` gives those that are due.

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
        """Whether nothing is on its way."""
        return not self._waiting

    def send(self, message: Message, block: int, faults: list[tuple[FaultTable, int, np.random.Generator]]) -> None:
        """Put a message on its way in a block.

        Args:
            message: the message.
            block: number of the block.
            faults: those that act, each with the block at which it ends and its random numbers.

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
                due += 1.5 * (self._sent % 2)  # after the next one, which comes a block later
            elif table.kind == "held":
                due = max(due, float(until))
            elif table.kind == "corrupted" and random.random() < size:
                copies = [Message(_corrupted(one.payload, random), one.of) for one in copies]
            elif table.kind == "truncated" and random.random() < size:
                copies = [one._replace(payload=one.payload[: random.integers(len(one.payload))]) for one in copies]
            elif table.kind == "forged":
                more = [Message(self._forged(message.payload), message.of)] * round(size)
        for one in (*copies, *more):
            if len(self._waiting) < _MOST_WAITING:
                heapq.heappush(self._waiting, (due, self._sent, one))
                self._sent += 1

    def arrive(self, block: int) -> list[Message]:
        """The messages that arrive in a block, in order of arrival."""
        found: list[Message] = []
        while self._waiting and self._waiting[0][0] < block + 1:
            found.append(heapq.heappop(self._waiting)[2])
        return found

    def _forged(self, payload: bytes) -> bytes:
        if self._commands:
            said = wire.Command.FromString(payload)
            said.run, said.amplitude_m, said.frequency_Hz = _FOREIGN_RUN, 1e-7, 4500.0
            return said.SerializeToString()
        block = wire.SensorBlock.FromString(payload)
        block.sequence += 1 << 40
        layout = sensor_block(len(block.drive_force_N))
        return sealed(layout.canonical(block.SerializeToString(), SENSORS.name))


def _corrupted(payload: bytes, random: np.random.Generator) -> bytes:
    """Bytes changed, half of the messages cut as well."""
    spoiled = bytearray(payload)
    for at in random.integers(0, len(spoiled), _CORRUPTED_BYTES):
        spoiled[at] ^= int(random.integers(1, 256))
    return bytes(spoiled[: len(spoiled) // 2] if random.random() < 0.5 else spoiled)
