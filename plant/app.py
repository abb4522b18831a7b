"""The plant process: the rig on the bus, paced to the wall clock or in lockstep with the controller."""

import collections
import threading
import time
from typing import Any

from bridge.faults import Fault
from bridge.wire import realtime
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import COMMAND as COMMAND_LAYOUT
from bridge.wire.topics import ANNOUNCE, APPLIED, COMMAND, PLANT_EVENT, SENSORS
from bridge.wire.zenoh_link import Bus, BusConfig, Inbox, Received
from plant.config import RigConfig
from plant.node import PlantNode

PEER_TIMEOUT_S = 30.0  # a first start compiles the controller's kernels
_ANSWER_TIMEOUT_S = 5.0  # lockstep: longest wait for the command that answers a block
_GOODBYE_S = 3.0  # longest wait for the other processes to leave the bus
_ROUND_TRIPS_KEPT = 1024  # blocks whose time of sending is kept; answers to older blocks have no round trip
_LATE_NS = 1_000_000  # round trip beyond which a command counts as late


def run(
    rig: RigConfig,
    seed: int,
    duration_s: float,
    bus_config: BusConfig,
    header: wire.Header,
    wait_for: list[str],
    lockstep: bool,
    stop: threading.Event,
) -> int:
    """Serve the rig on the bus until `duration_s` is over (0: for ever) or `stop` is set; how many blocks.

    Raises Fault ENDPOINT_BUSY, NO_PEER, LOCKSTEP_STALLED, BAD_MESSAGE.
    """
    node = PlantNode(rig, seed)
    node.warm_up()
    blocks = round(duration_s / rig.solver.block_s) if duration_s > 0 else 2**62
    with Bus(bus_config, "plant", lockstep) as bus:
        bus.serve_header(header)
        process = _Process(node, bus)
        # before the other processes hear of this one: claimed later, the link may lapse on busy cores (docs/method/plant.md)
        if lockstep:
            realtime.claim(realtime.core(bus_config.port), realtime.LOCKSTEP_PRIORITY)
            granted = "lockstep"  # the same text everywhere: the same run gives the same log
        else:
            granted = realtime.claim(realtime.core(0))
        bus.announce()
        wait_for_peers(bus, bus_config.endpoint, wait_for, stop)
        process.event("START", granted)
        advance = process.lockstep if lockstep else process.realtime
        advance(blocks, stop)
        process.event("END", f"blocks={node.block}")
        bus.wait_until_alone(_GOODBYE_S)  # this process relays the messages of the others, so it leaves last
    return node.block


def wait_for_peers(bus: Bus, endpoint: str, roles: list[str], stop: threading.Event) -> None:
    """Wait until all `roles` are on the bus, or `stop` is set. Raises Fault NO_PEER."""
    until_s = time.monotonic() + PEER_TIMEOUT_S
    missing = bus.wait_for(roles, 0.0)
    while missing and time.monotonic() < until_s and not stop.is_set():
        missing = bus.wait_for(roles, 0.2)
    if missing and not stop.is_set():
        raise Fault("NO_PEER", f"{endpoint}: no {' and no '.join(sorted(missing))} within {PEER_TIMEOUT_S:g} s")


class _Process:
    def __init__(self, node: PlantNode, bus: Bus) -> None:
        self._node = node
        self._bus = bus
        self._commands: collections.deque[Received] = collections.deque(maxlen=64)
        self._answers = Inbox(64)
        self._events = 0
        self._send_sensors = bus.publisher(SENSORS)
        self._send_applied = bus.publisher(APPLIED)
        self._send_announce = bus.publisher(ANNOUNCE)
        self._send_event = bus.publisher(PLANT_EVENT)
        bus.listen(COMMAND, self._receive)

    def _receive(self, received: Received) -> None:
        self._commands.append(received)
        self._answers.push(received)

    def event(self, code: str, text: str) -> None:
        """Publish an event with a code and a text."""
        t_ns = self._node.block * self._node.block_ns
        event = wire.Event(sequence=self._events, t_ns=t_ns, source="plant", code=code, text=text)
        self._events += 1
        self._send_event(event.SerializeToString())

    def _announce(self) -> None:
        for message in self._node.announcements:
            self._send_announce(message.payload)

    def realtime(self, blocks: int, stop: threading.Event) -> None:
        """Advance one block a period under the newest command; after `stop`, until the vibration has faded."""
        node, pacer = self._node, realtime.Pacer(self._node.block_ns)
        sent_ns = [0] * _ROUND_TRIPS_KEPT
        fading = 0
        tick = 0
        while node.block < blocks:
            late_ns = pacer.wait(tick)
            tick += 1
            commands: list[bytes] = []
            round_trip_ns = 0
            late_commands = 0
            while self._commands:
                received = self._commands.popleft()
                commands.append(received.payload)
                answered = int(COMMAND_LAYOUT.read(received.payload, COMMAND.name)[0].block)
                if 0 < node.block - answered <= _ROUND_TRIPS_KEPT:
                    round_trip_ns = received.arrival_ns - sent_ns[answered % _ROUND_TRIPS_KEPT]
                    late_commands += round_trip_ns > _LATE_NS
            if stop.is_set():
                node.let_go()
                commands = []
                fading += 1
            sensors, applied = node.advance(commands, late_commands, round_trip_ns, late_ns)
            sent_ns[(node.block - 1) % _ROUND_TRIPS_KEPT] = time.perf_counter_ns()
            self._announce()
            self._send_sensors(sensors.payload)
            self._send_applied(applied.payload)
            if fading and (node.at_rest or fading > 1000):
                return

    def lockstep(self, blocks: int, stop: threading.Event) -> None:
        """Advance block by block; each block waits for the command that answers the block before."""
        node = self._node
        commands: list[bytes] = []
        while node.block < blocks and not stop.is_set():
            sensors, applied = node.advance(commands)
            self._announce()
            self._send_sensors(sensors.payload)
            self._send_applied(applied.payload)
            commands = [self._answer(node.block - 1, stop)]

    def _answer(self, block: int, stop: threading.Event) -> bytes:
        until_s = time.monotonic() + _ANSWER_TIMEOUT_S
        while time.monotonic() < until_s and not stop.is_set():
            received = self._answers.get(0.1)
            if received is not None:
                command: Any = COMMAND_LAYOUT.read(received.payload, COMMAND.name)[0]
                if command.block == block:
                    return received.payload
            elif not self._bus.alive("controller"):
                raise Fault("PEER_DIED", f"the controller left the bus; block {block} got no answer")
        if stop.is_set():
            return b""
        raise Fault("LOCKSTEP_STALLED", f"block {block}: no command answered it within {_ANSWER_TIMEOUT_S:g} s")
