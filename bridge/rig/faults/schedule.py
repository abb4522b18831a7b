"""The faults that act in a block: their effects on the rig and its bus, and events at their begin and end."""

import collections
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from bridge.arrays import Records
from bridge.faults import Fault
from bridge.rig.faults.clock import ClockFault
from bridge.rig.faults.kinds import BUS, CLOCK, EXCITER, LINK, SENSORS
from bridge.rig.faults.line import Line, Message
from bridge.rig.faults.sensors import SensorFault
from bridge.rig.faults.table import FaultTable, ordered
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.payloads import parsed
from bridge.wire.topics import FAULT

BEGAN, ENDED = "INJECTED", "INJECTION_ENDED"  # codes of the events
_STREAM = 2  # random stream of the faults: noise and jitter of a rig use other streams of its seed
_NEVER = 1 << 62
SetExciter = Callable[
    [list[tuple[FaultTable, float]]], None
]  # sets the acting faults, each with the time since its begin [s]
_REMEMBERED = 64  # orders whose ids are stored; a repeated order arrives within a second


class _Planned(NamedTuple):
    """One fault of the run."""

    table: FaultTable
    begin: int  # number of its first block
    end: int  # number of the first block after it
    random: np.random.Generator
    sensor: SensorFault | None
    clock: ClockFault | None


class Faults:
    """The faults of one rig.

    Args:
        tables: faults of the scenario.
        seed: the rig's seed.
        block_s, samples: length of a block and its samples.
        exciter: sets the faults of a simulated exciter; None: a real one, which has none.

    """

    def __init__(
        self, tables: Sequence[FaultTable], seed: int, block_s: float, samples: int, exciter: SetExciter | None = None
    ) -> None:
        self.busy = False  # whether any fault is planned or acts, or a message is delayed
        self.on_the_bus = False  # whether any fault of the bus acts, or a message is delayed
        self._seed, self._block_s, self._sample_s = seed, block_s, block_s / samples
        self._exciter = exciter
        self._planned: list[_Planned] = []
        self._acting: list[_Planned] = []
        self._news: list[tuple[str, str]] = []
        self._lines = {"blocks": Line(block_s, commands=False), "commands": Line(block_s, commands=True)}
        self._made = 0
        self._taken: collections.deque[str] = collections.deque(maxlen=_REMEMBERED)
        for table in tables:
            self.add(table, 0)

    def add(self, table: FaultTable, block: int) -> None:
        """Plan a fault; its times count from block `block`. Raises Fault CONFIG for a fault of a real exciter."""
        if table.group == EXCITER and self._exciter is None:
            line = f"{FAULT.name}: target = {table.target}: must be a simulated exciter, and this one is real"
            raise Fault("CONFIG", f"{line}; change the exciter itself")
        random = np.random.Generator(np.random.PCG64([self._seed, _STREAM, self._made]))
        self._made += 1
        begin = block + round(table.from_s / self._block_s)
        end = begin + max(round(table.for_s / self._block_s), 1) if table.for_s > 0.0 else _NEVER
        sensor = SensorFault(table, random, self._sample_s) if table.group == SENSORS else None
        clock = ClockFault(table) if table.group == CLOCK else None
        self._planned.append(_Planned(table, begin, end, random, sensor, clock))
        self.busy = True

    def take(self, payload: bytes, block: int) -> None:
        """Add the fault of an operator's request from block `block` on; a repeated request is ignored.

        Raises Fault BAD_MESSAGE for a malformed request, CONFIG for an invalid fault of a rig.
        """
        order = parsed(wire.Inject, payload, FAULT.name)
        if order.id and order.id in self._taken:
            return
        self._taken.append(order.id)
        table = ordered(order.fault) if order.fault else None
        if order.clear:  # ends all acting faults and drops all planned ones
            self._planned = [fault._replace(end=block) for fault in self._acting]
        if table is not None:
            self.add(table, block)

    def begin_block(self, block: int) -> None:
        """Update the acting faults; call it before the rig is advanced."""
        before = self._acting
        self._acting = [fault for fault in self._planned if fault.begin <= block < fault.end]
        for fault in self._acting:
            if fault.begin == block:
                length = f" for {fault.table.for_s:g} s" if fault.table.for_s > 0.0 else " to the end"
                self._news.append((BEGAN, f"{fault.table.in_words()}{length}"))
        for fault in before:
            if fault not in self._acting:
                self._news.append((ENDED, fault.table.in_words()))
        self._planned = [fault for fault in self._planned if block < fault.end]
        if self._exciter is not None and any(fault.table.group == EXCITER for fault in (*before, *self._acting)):
            exciter = [fault for fault in self._acting if fault.table.group == EXCITER]
            self._exciter([(fault.table, self._since_s(fault, block)) for fault in exciter])
        on_the_way = not (self._lines["blocks"].empty and self._lines["commands"].empty)
        self.on_the_bus = on_the_way or any(fault.table.group == BUS for fault in self._acting)
        self.busy = on_the_way or bool(self._planned or self._acting)

    def _since_s(self, fault: _Planned, block: int) -> float:
        return (block - fault.begin) * self._block_s

    def spoil(self, sensors: Records, block: int) -> None:
        """Apply the sensor faults to the samples of a block, one record."""
        for fault in self._planned:
            if fault.sensor is not None:
                if fault.begin <= block:
                    fault.sensor.spoil(sensors[0], self._since_s(fault, block))
                elif fault.begin == block + 1:
                    fault.sensor.look(sensors[0])

    def misdate(self, messages: Sequence[Records], block: int) -> None:
        """Apply the clock faults to times and numbers of the messages of a block, one record each."""
        for fault in self._acting:
            if fault.clock is not None:
                for message in messages:
                    fault.clock.misdate(message[0], self._since_s(fault, block))

    def on_the_way(self, direction: str, messages: Sequence[Message], block: int) -> list[Message]:
        """Send `messages` in the direction `blocks` or `commands`; return the messages that arrive in this block."""
        line = self._lines[direction]
        acting = [
            (fault.table, fault.end, fault.random)
            for fault in self._acting
            if fault.table.group == BUS and fault.table.target in (direction, LINK)
        ]
        for message in messages:
            line.send(message, block, acting)
        return line.arrive(block)

    def news(self) -> list[tuple[str, str]]:
        """Codes and texts of the faults that began or ended since the last call."""
        events, self._news = self._news, []
        return events
