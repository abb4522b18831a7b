"""A device for the adapter `stream` that misbehaves, in simulated time and in the thread of its client: no clock, no race.

`BadDevice` takes the place of the modules `select` and `time` in the adapter: its time passes while the adapter waits for bytes.
"""

import contextlib
import select as machine
import socket
import struct
from collections import deque

import numpy as np

from plant.config import RigConfig
from plant.records import TRUTH
from plant.rig.device import PlantDevice
from tests.patience import PATIENCE_S

BEGIN = 600  # block at which a misbehaviour begins, unless it is there from the start
DEAD_MAN_BLOCKS = 100
SLIDE = TRUTH.index("true_velocity_mps")
DRIVE = TRUTH.index("true_drive_position_m")


class BadDevice:
    """The device: `fault` names its misbehaviour; an empty name is a healthy device."""

    def __init__(self, rig: RigConfig, fault: str) -> None:
        self.fault = fault
        self.now_s = 0.0
        self.vibration_mps: list[float] = []
        self.drive_m: list[float] = []
        self._physics = PlantDevice(rig, 1)
        self._block_s = self._physics.block_s / (1.03 if fault == "clock 3 % off" else 1.0)
        self._server = socket.create_server(("127.0.0.1", 0))
        self._server.setblocking(False)
        self.address = f"127.0.0.1:{self._server.getsockname()[1]}"
        self._client: socket.socket | None = None
        self._received = bytearray()
        self._orders: deque[tuple[float, float, int, int]] = deque()
        self._order = 2600.0, 0.0, 0, 0
        self._silent_blocks = 0
        self._made, self._first = 0, 0
        self._held: list[bytes] = []
        self._random = np.random.default_rng(1)
        self._last = np.zeros((5, 20))

    def close(self) -> None:
        self._drop_client()
        self._server.close()

    # the modules `time` and `select` for the adapter

    def monotonic(self) -> float:
        return self.now_s

    def now_ns(self) -> int:
        return round(self.now_s * 1e9)

    def sleep(self, for_s: float) -> None:
        self._advance(self.now_s + for_s)

    def select(self, readers: list[int], _w: list[int], _x: list[int], timeout_s: float) -> tuple[list[int], ...]:
        until_s = self.now_s + timeout_s
        while True:
            sent = self._advance(min(until_s, (self._made + 1) * self._block_s))
            if sent or self.now_s >= until_s:
                # sent bytes cross the loopback at once, but not in this very instant
                return machine.select(readers, [], [], PATIENCE_S if sent else 0.0)

    def _advance(self, to_s: float) -> bool:
        sent = False
        while (self._made + 1) * self._block_s <= to_s + 1e-9:
            self.now_s = (self._made + 1) * self._block_s
            sent |= self._make_block()
        self.now_s = max(self.now_s, to_s)
        return sent

    # the device

    def _acts(self, for_blocks: int = 1 << 30) -> bool:
        return BEGIN <= self._made < BEGIN + for_blocks

    def _make_block(self) -> bool:
        """Make a block; whether bytes were sent, or the connection ended."""
        number = self._made - self._first
        self._take_orders()
        self._silent_blocks += 1
        frequency_Hz, amplitude, enable, toggle = self._order
        if self._silent_blocks > DEAD_MAN_BLOCKS or self._client is None:
            amplitude = 0.0
        self._physics.enable(bool(enable), toggle)
        self._physics.write(frequency_Hz, amplitude)
        block = self._physics.read()
        self.vibration_mps.append(self._physics.vibration_mps)
        self.drive_m.append(float(self._physics.truth[DRIVE, -1]))
        samples = self._spoiled(block.samples)
        frame = self._frame(number, samples, block.frequency_Hz, block.amplitude)
        frames = self._misbehave(number, frame)
        self._made += 1
        if frames is None:
            self._drop_client()
            return True
        if self._client is None or not frames:
            return False
        with contextlib.suppress(OSError):
            self._client.sendall(b"".join(frames))
        return True

    def _frame(self, number: int, samples: np.ndarray, frequency_Hz: float, amplitude: float) -> bytes:
        head = struct.pack("<4sIQdd", b"SSR1", 24 + 4 * samples.size, number, frequency_Hz, amplitude)
        return head + samples.T.astype("<f4").tobytes()

    def _spoiled(self, samples: np.ndarray) -> np.ndarray:
        if self.fault == "NaN" and self._acts():
            samples[2] = np.nan
        elif self.fault == "clipped" and self._acts():
            samples[2] = samples[2].clip(-3.0, 3.0)
        elif self.fault == "stuck" and self._acts():
            return self._last
        elif self.fault == "short" and self._acts() and self._made % 100 == 0:
            return samples[:, :10]
        self._last = samples
        return samples

    def _misbehave(self, number: int, frame: bytes) -> list[bytes] | None:
        """The frames to be sent now; None: end the connection."""
        fault, turn = self.fault, self._made % 100
        if fault == "garbage at the start" and number == 0:
            return [self._random.bytes(1000), frame]
        if fault in {"gone", "restarts", "two clients"} and self._acts(1):
            return None
        if fault == "restarts" and self._made == BEGIN + 1:
            self._first = self._made
        if not self._acts():
            return [frame]
        if fault == "repeated" and turn == 0:
            return [frame, frame]
        if fault == "lost" and turn == 0:
            return []
        if fault == "silent for 1 s" and self._acts(1000):
            return []
        if fault == "swapped order" and turn < 2:
            self._held.append(frame)
            return [] if turn == 0 else [self._held.pop(), self._held.pop()]
        if fault == "late":
            self._held.append(frame)
            return [] if turn < 30 else [self._held.pop(0) for _ in range(len(self._held))]
        return [frame]

    def _take_orders(self) -> None:
        self._accept()
        if self._client is None:
            return
        try:
            received = self._client.recv(1 << 16)
        except BlockingIOError:
            received = None
        except OSError:
            received = b""
        if received == b"":
            self._drop_client()
            return
        self._received += received or b""
        while len(self._received) >= 32:
            _, _, *order = struct.unpack_from("<4sIddII", self._received)
            del self._received[:32]
            self._orders.append(tuple(order))
            self._silent_blocks = 0
        if self.fault == "refuses" and self._acts():
            self._orders.clear()  # it goes on as before
        elif self.fault == "slow":
            if self._orders and self._made % 30 == 0:
                self._order = self._orders.popleft()
        elif self._orders:
            self._order = self._orders.pop()
            self._orders.clear()

    def _accept(self) -> None:
        with contextlib.suppress(BlockingIOError):
            client, _ = self._server.accept()
            is_held = self.fault == "two clients" and self._made > BEGIN
            if is_held or (self.fault == "gone" and self._acts()):
                client.close()
                return
            client.setblocking(False)
            self._client = client

    def _drop_client(self) -> None:
        if self._client is not None:
            self._client.close()
        self._client = None
        self._received.clear()
        self._orders.clear()
        self._order = 2600.0, 0.0, 0, 0
        if self.fault == "gone":
            self._server.close()
            self._server = socket.create_server(("127.0.0.1", 0))
            self._server.setblocking(False)
