"""Messages of a made-up rig, as they come from the bus."""

import json
from collections.abc import Iterable
from typing import Any

import numpy as np

from bridge.wire import stickslip_pb2 as wire
from bridge.wire.inbox import Inbox, Received
from bridge.wire.messages import APPLIED, TRACE, sensor_block
from bridge.wire.topics import APPLIED as APPLIED_TOPIC
from bridge.wire.topics import PLANT_EVENT, SENSORS
from bridge.wire.topics import TRACE as TRACE_TOPIC
from cockpit.live.listener import Presence, Source

BLOCK_NS = 1_000_000
SAMPLES = 20
HERE = Presence(True, frozenset({"plant", "controller", "recorder"}), "")
GONE = Presence(False, frozenset(), "")


class Rig(Source):
    """A source for a `View`, and its clock."""

    def __init__(self) -> None:
        rig = {"name": "lathe", "piezo": {"amplitude_max_m": 1e-7}}
        super().__init__(Inbox(1 << 14), HERE, {"plant": {"rig": rig}}, {"plant": "lathe", "controller": "lathe"})
        self.now_s = 100.0

    def clock(self) -> float:
        return self.now_s

    def say(self, topic: Any, payload: bytes) -> None:
        self.inbox.push(Received(topic, payload, round(self.now_s * 1e9)))

    def block(self, number: int, force_N: float = 10.0, peak_N: float | None = None) -> None:
        record = sensor_block(SAMPLES).blank()
        record["sequence"], record["t_ns"] = number, (number + 1) * BLOCK_NS
        record["drive_force_N"] = force_N
        if peak_N is not None:
            record["drive_force_N"][0, 7] = peak_N
        self.say(SENSORS, record.tobytes())

    def answer(self, number: int, slips: int = 0, mode: int = wire.EXCITE, **more: Any) -> None:
        trace = TRACE.blank()
        trace["sequence"] = trace["block"] = number
        trace["t_ns"], trace["slips"], trace["mode"] = (number + 1) * BLOCK_NS, slips, mode
        trace["time_to_slip_s"], trace["state"] = -1.0, wire.SMOOTH
        trace["vibration_velocity_mps"], trace["drive_velocity_mps"], trace["reason"] = 6e-4, 5e-4, wire.STICK_SEEN
        for name, value in more.items():
            trace[name] = value
        self.say(TRACE_TOPIC, trace.tobytes())

    def applied(self, number: int, **more: Any) -> None:
        applied = APPLIED.blank()
        applied["sequence"], applied["t_ns"] = number, (number + 1) * BLOCK_NS
        applied["commands"], applied["round_trip_ns"], applied["guard_state"] = 1, 200_000, wire.ACTIVE
        for name, value in more.items():
            applied[name] = value
        self.say(APPLIED_TOPIC, applied.tobytes())

    def event(self, code: str, text: str) -> None:
        event = wire.Event(source="plant", code=code, text=text)
        self.say(PLANT_EVENT, event.SerializeToString())

    def blocks(self, numbers: Iterable[int], slips: int = 0) -> None:
        for number in numbers:
            self.block(number)
            self.answer(number, slips)
            self.applied(number)


def column(values: np.ndarray, names: tuple[str, ...], name: str) -> Any:
    return values[names.index(name)]


def table_of_frame(frame: bytes) -> tuple[dict[str, Any], np.ndarray]:
    """JSON and columns of a frame."""
    length = int.from_bytes(frame[:4], "little")
    table = json.loads(frame[4 : 4 + length])
    values = np.frombuffer(frame[4 + length :], "<f4").reshape(table["rows"], table["count"])
    return table, values
