"""A simulated device in another process, for tests of the adapters: the plant's physics behind a TCP port, with frames of
`stream`.

It shares no code with the adapters. Its exciter may be a generator with command lines (`plant.rig.generator`) at another
port. Its clock may be wrong, it has a dead man, and it records its true vibration.
"""

import contextlib
import select
import socket
import struct
import threading
import time
from pathlib import Path
from typing import IO, Annotated

import numpy as np
from pydantic import Field

from bridge.config import Strict
from plant.config import RigConfig
from plant.records import TRUTH
from plant.rig.device import PlantDevice
from plant.rig.generator import Generator, GeneratorConfig

_POSITION, _VELOCITY = TRUTH.index("true_drive_position_m"), TRUTH.index("true_velocity_mps")
_FRAME_HEAD = struct.Struct("<4sIQdd")
_ORDER = struct.Struct("<4sIddII")
_LOOK_S = 0.05  # interval at which a box that waits looks for its end
_HEADING = "t_s,v_a_mps,v_d_mps,slide_mps,frequency_Hz,amplitude_m\n"


class BoxConfig(Strict):
    """One file of `stickslip rig box`."""

    rig: str = Field(description="Simulated rig: a name in deploy/rigs, or a .toml file.")
    settings: list[str] = Field([], description="key=value each, changes of this rig.")
    host: str = "127.0.0.1"
    port: Annotated[int, Field(ge=0, le=65535)] = Field(0, description="0: any free port, printed at the start.")
    seed: Annotated[int, Field(ge=0)] = 1
    clock_ppm: Annotated[float, Field(gt=-5e5, le=5e5)] = Field(0.0, description="Error of its clock; above 0: fast.")
    dead_man_s: Annotated[float, Field(gt=0)] = Field(0.1, description="Time without a command until it rests.")
    waits: bool = Field(False, description="true: each block waits for its command, so that no clock is needed.")
    generator: GeneratorConfig | None = Field(None, description="Not given: the frames set the exciter.")
    record: str = Field("", description="CSV file of the true motion of each block; empty: none.")


class Box:
    """The device.

    Args:
        config: its file.
        rig: the simulated rig of the file.

    """

    def __init__(self, config: BoxConfig, rig: RigConfig) -> None:
        self._config = config
        PlantDevice(rig, config.seed).read()  # compiles or loads the kernels before anyone waits for a block
        self._device = PlantDevice(rig, config.seed)
        self._server = socket.create_server((config.host, config.port))
        self._server.setblocking(False)
        self.generator = Generator(config.generator, config.host) if config.generator is not None else None
        self.port = int(self._server.getsockname()[1])
        self._client: socket.socket | None = None
        self._received = bytearray()
        self._blocks = 0
        self._silent_blocks = 0
        self._drive_m = 0.0

    def run(self, stop: threading.Event) -> None:
        """Make blocks until `stop` is set."""
        record = Path(self._config.record) if self._config.record else None
        block_s = self._device.block_s / (1.0 + 1e-6 * self._config.clock_ppm)
        with self._server, record.open("w", buffering=1) if record else contextlib.nullcontext() as file:
            if file is not None:
                file.write(_HEADING)
            begun_s = time.monotonic()
            while not stop.is_set():
                if self._config.waits:
                    if not self._is_answered():
                        continue
                else:
                    time.sleep(max(begun_s + (self._blocks + 1) * block_s - time.monotonic(), 0.0))
                    self._accept()
                    self._receive()
                    self._generate()
                self._make_block(file)
            self._forget()
        if self.generator is not None:
            self.generator.close()

    def _generate(self) -> None:
        """Let the generator, if there is one, set the exciter."""
        if self.generator is not None:
            now_s = self._blocks * self._device.block_s
            self.generator.poll(now_s, at_once=self._config.waits and self._client is None)
            self._device.enable(on=True, toggle=0)
            self._device.write(*self.generator.vibration(now_s))

    def _is_answered(self) -> bool:
        """Wait for a client and its command; whether there was one."""
        waiting = [self._client or self._server]
        ready = select.select(waiting + (self.generator.sockets if self.generator else []), [], [], _LOOK_S)[0]
        self._generate()
        if waiting[0] not in ready:
            return False
        self._accept()
        return self._receive()

    def _accept(self) -> None:
        """Take a client; while it is connected, others are refused."""
        with contextlib.suppress(BlockingIOError):
            client, _ = self._server.accept()
            if self._client is not None:
                client.close()
                return
            client.setblocking(False)
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._client = client

    def _forget(self) -> None:
        """End the connection; the exciter rests."""
        if self._client is not None:
            self._client.close()
        self._client = None
        self._received.clear()
        self._device.safe()

    def _receive(self) -> bool:
        """Carry out the newest command; whether there was one."""
        if self._client is None:
            return False
        try:
            data = self._client.recv(1 << 16)
        except BlockingIOError:
            data = None
        except OSError:
            data = b""
        if data == b"":
            self._forget()
            return False
        self._received += data or b""
        whole = len(self._received) // _ORDER.size * _ORDER.size
        if not whole:
            return False
        _, _, frequency_Hz, amplitude_m, enable, toggle = _ORDER.unpack_from(self._received, whole - _ORDER.size)
        del self._received[:whole]
        if self.generator is None:
            self._device.enable(bool(enable), toggle)
            self._device.write(frequency_Hz, amplitude_m)
        self._silent_blocks = 0
        return True

    def _make_block(self, record: IO[str] | None) -> None:
        self._silent_blocks += 1
        if self.generator is None and self._silent_blocks * self._device.block_s > self._config.dead_man_s:
            self._device.safe()
        block = self._device.read()
        head = _FRAME_HEAD.pack(b"SSR1", 24 + 4 * block.samples.size, self._blocks, block.frequency_Hz, block.amplitude)
        self._blocks += 1
        if self._client is not None:
            try:
                self._client.sendall(head + block.samples.T.astype("<f4").tobytes())
            except OSError:  # it is gone, or reads nothing
                self._forget()
        if record is not None:
            truth, block_s = self._device.truth, self._device.block_s
            drive_m, speeds_mps = float(truth[_POSITION, -1]), truth[_VELOCITY]
            drive_mps, self._drive_m = (drive_m - self._drive_m) / block_s, drive_m
            fastest_mps = float(speeds_mps[np.abs(speeds_mps).argmax()])
            row = self._blocks * block_s, self._device.vibration_mps, drive_mps, fastest_mps
            record.write(",".join(f"{value:.6g}" for value in (*row, block.frequency_Hz, block.amplitude)) + "\n")
