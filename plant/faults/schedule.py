"""Which faults act in a block, and what they do there; their begin and end in words."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from plant.faults.clock import ClockFault
from plant.faults.exciter import Exciter
from plant.faults.kinds import BUS, CLOCK, EXCITER, LINK, SENSORS
from plant.faults.line import Line, Message
from plant.faults.sensors import SensorFault
from plant.faults.table import FaultTable

BEGAN, ENDED = "INJECTED", "INJECTION_ENDED"  # codes of the events
_STREAM = 2  # of the seed: noise and jitter of a rig stay as they are
_NEVER = 1 << 62


class _Planned(NamedTuple):
    """One fault of the run."""

    table: FaultTable
    begin: int  # number of its first block
    end: int  # and of the first after it
    random: np.random.Generator
    sensor: SensorFault | None
    clock: ClockFault | None


class Faults:
    """The faults of one rig.

    Args:
        tables: of the scenario.
        seed: of the rig.
        block_s, samples: length of a block and its samples.
        params: record of `plant.records.PARAMS`, of which faults of the exciter change some numbers.

    """

    def __init__(
        self, tables: Sequence[FaultTable], seed: int, block_s: float, samples: int, params: npt.NDArray[Any]
    ) -> None:
        self.busy = False  # whether any fault is planned, acts, or has left something on its way
        self.on_the_bus = False  # whether any of the bus acts, or has left something on its way
        self._seed, self._block_s, self._sample_s = seed, block_s, block_s / samples
        self._params = params
        self._exciter: Exciter | None = None
        self._planned: list[_Planned] = []
        self._acting: list[_Planned] = []
        self._news: list[tuple[str, str]] = []
        self._lines = {"blocks": Line(block_s, commands=False), "commands": Line(block_s, commands=True)}
        self._made = 0
        for table in tables:
            self.add(table, 0)

    def add(self, table: FaultTable, block: int) -> None:
        """Plan a fault; its times count from a block."""
        random = np.random.Generator(np.random.PCG64([self._seed, _STREAM, self._made]))
        self._made += 1
        begin = block + round(table.from_s / self._block_s)
        end = begin + max(round(table.for_s / self._block_s), 1) if table.for_s > 0.0 else _NEVER
        sensor = SensorFault(table, random, self._sample_s) if table.group == SENSORS else None
        clock = ClockFault(table) if table.group == CLOCK else None
        self._planned.append(_Planned(table, begin, end, random, sensor, clock))
        self.busy = True

    def clear(self, block: int) -> None:
        """End all that act and forget all that are to come."""
        self._planned = [one._replace(end=block) for one in self._acting]

    def begin_block(self, block: int) -> None:
        """What acts in this block; call it before the rig is advanced."""
        before = self._acting
        self._acting = [one for one in self._planned if one.begin <= block < one.end]
        for one in self._acting:
            if one.begin == block:
                length = f" for {one.table.for_s:g} s" if one.table.for_s > 0.0 else " to the end"
                self._news.append((BEGAN, f"{one.table.in_words()}{length}"))
        for one in before:
            if one not in self._acting:
                self._news.append((ENDED, one.table.in_words()))
        self._planned = [one for one in self._planned if block < one.end]
        exciter = [(one.table, self._since_s(one, block)) for one in self._acting if one.table.group == EXCITER]
        if exciter or self._exciter is not None:
            self._exciter = self._exciter or Exciter(self._params[0])
            self._exciter.set(exciter)
            self._exciter = self._exciter if exciter else None
        self.on_the_bus = any(one.table.group == BUS for one in self._acting) or not self._lines_empty
        self.busy = bool(self._planned) or bool(self._acting) or not self._lines_empty

    @property
    def _lines_empty(self) -> bool:
        return all(line.empty for line in self._lines.values())

    def _since_s(self, one: _Planned, block: int) -> float:
        return (block - one.begin) * self._block_s

    def spoil(self, sensors: npt.NDArray[Any], block: int) -> None:
        """Change the samples of a block, one record, as its sensors fail."""
        for one in self._planned:
            if one.sensor is not None:
                if one.begin <= block:
                    one.sensor.spoil(sensors[0], self._since_s(one, block))
                elif one.begin == block + 1:
                    one.sensor.look(sensors[0])

    def misdate(self, messages: Sequence[npt.NDArray[Any]], block: int) -> None:
        """Change times and numbers of the messages of a block, one record each, as its clock fails."""
        for one in self._acting:
            if one.clock is not None:
                for message in messages:
                    one.clock.misdate(message[0], self._since_s(one, block))

    def on_the_way(self, direction: str, messages: Sequence[Message], block: int) -> list[Message]:
        """What arrives in a block of `blocks` or `commands`, after these messages were sent."""
        line = self._lines[direction]
        acting = [
            (one.table, one.end, one.random)
            for one in self._acting
            if one.table.group == BUS and one.table.target in (direction, LINK)
        ]
        for message in messages:
            line.send(message, block, acting)
        return line.arrive(block)

    def news(self) -> list[tuple[str, str]]:
        """Codes and texts of what began and ended since the last call."""
        told, self._news = self._news, []
        return told
