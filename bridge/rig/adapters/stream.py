"""Frames over TCP, or over stdin and stdout of a program that we start: samples in, frequency and amplitude out.

Every number is little endian. The device sends a frame for each block, as soon as the block is complete:

    mark "SSR1"   uint32: bytes after this field   uint64: number of the block, from 0, without a gap
    float64: frequency [Hz] and float64: amplitude of the exciter at the block's end; NaN if the device does not know them
    float32 [samples][channels]: the samples in the order of time; NaN for a missing one

It receives a frame in each block, the newest of which holds:

    mark "SSC1"   uint32: 24   float64: frequency [Hz]   float64: amplitude   uint32: enable line   uint32: toggle

Without a command for its watchdog time, and once the connection ends, the device ends the vibration by itself.
"""

import contextlib
import math
import os
import select
import socket
import struct
import subprocess
import time
from typing import IO

import numpy as np
from pydantic import model_validator

from bridge.config import Strict, validate
from bridge.faults import Fault
from bridge.rig.device import Device, DeviceBlock, DeviceError, Setup

_MARK, _COMMAND_MARK = b"SSR1", b"SSC1"
_HEAD = struct.Struct("<4sIQdd")
_COMMAND = struct.Struct("<4sIddII")
_LENGTH_BYTES = 8  # of mark and length, which the length does not count
_READ_BYTES = 1 << 16
_MOST_BYTES = 1 << 24  # most bytes that wait in this process: 30 s of blocks of 1 ms
_CONNECT_S = 2.0
_END_S = 1.0  # longest wait for a program to end
# A number this far below the expected one is late or repeated; a lower one begins a new count. Larger: a device that restarts
# soon after its start is ignored until it has caught up.
_LATE_BLOCKS = 256


class StreamSettings(Strict):
    """The table `[device]`."""

    address: str = ""
    command: list[str] = []
    waits: bool = False  # a simulated device makes a block only after a command
    channels: int = 0  # of a frame, if it has more than the rig file uses; 0: as many

    @model_validator(mode="after")
    def _is_one(self) -> "StreamSettings":
        if bool(self.address) == bool(self.command):
            given = "both" if self.address else "neither"
            raise ValueError(
                f"address, command: {given} given: must be one; give address = 'HOST:PORT' or command = ['PROGRAM']"
            )
        if self.address and not self.address.rpartition(":")[2].isdecimal():
            raise ValueError(f"address = {self.address!r}: must be HOST:PORT; add the port")
        return self


class Adapter(Device):
    """A device that sends and receives frames."""

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        self._settings = validate(StreamSettings, dict(setup.settings), "device")
        self.pace = "caller" if self._settings.waits else "device"
        channels = self._settings.channels or setup.channels
        if channels < setup.channels:
            rule = f"must be {setup.channels} or more, as the rig file has source = {setup.channels - 1}; raise it"
            raise Fault("CONFIG", f"device.channels = {channels}: {rule}, or change the source")
        self._shape = setup.samples_per_block, channels
        self._size = _HEAD.size + 4 * setup.samples_per_block * channels
        self._begin_of_frame = _MARK + (self._size - _LENGTH_BYTES).to_bytes(4, "little")
        self._expected: int | None = None  # number of the next block; None before the first one
        self._problems: list[tuple[str, str]] = []
        self._socket: socket.socket | None = None
        self._program: subprocess.Popen[bytes] | None = None
        self._in = self._out = -1
        self._begin()

    def _begin(self) -> None:
        self._bytes, self._unsent = bytearray(), b""
        self._before, self._expected = self._expected, None
        self._lost = 0
        self._is_short = False  # whether the rest of a short frame follows
        self._written = 0.0, 0.0
        self._line = 0, 0

    def open(self) -> None:
        """Connect, or start the program."""
        self._begin()
        try:
            if self._settings.address:
                host, _, port = self._settings.address.rpartition(":")
                self._socket = socket.create_connection((host.strip("[]"), int(port)), _CONNECT_S)
                self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._in = self._out = self._socket.fileno()
            else:
                self._program = subprocess.Popen(
                    self._settings.command, cwd=self.setup.folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE
                )
                self._in, self._out = _number(self._program.stdout), _number(self._program.stdin)
            os.set_blocking(self._in, False)
            os.set_blocking(self._out, False)
        except (OSError, OverflowError) as error:
            self.close()
            place = self._settings.address or " ".join(self._settings.command)
            raise DeviceError(f"{place}: {getattr(error, 'strerror', None) or error}") from None

    def read(self) -> DeviceBlock | None:
        """The next frame as a block."""
        until_s = time.monotonic() + self.longest_read_s
        self._receive()
        while (block := self._next()) is None:
            left_s = until_s - time.monotonic()
            if left_s <= 0.0 or not select.select([self._in], [], [], left_s)[0]:
                return None
            self._receive()
        return block

    def _receive(self) -> None:
        """Take all received bytes, as their number shows how far this process is behind."""
        while len(self._bytes) < _MOST_BYTES:
            try:
                received = os.read(self._in, _READ_BYTES)
            except BlockingIOError:
                return
            except OSError as error:
                raise self._ended(f"the connection is lost: {error.strerror}") from None
            if not received:
                raise self._ended("the device ended the connection")
            self._bytes += received
            if len(received) < _READ_BYTES:
                return

    def _ended(self, text: str) -> DeviceError:
        if self._expected is None and not self._bytes:
            return DeviceError(f"{text}, before its first block: another client may hold the device", "DEVICE_BUSY")
        return DeviceError(text)

    def _next(self) -> DeviceBlock | None:
        """The first block in the received bytes; other bytes before it are dropped."""
        while (at := self._bytes.find(_MARK)) >= 0 and len(self._bytes) >= at + _HEAD.size:
            self._drop(at, "DEVICE_DATA", f"{at} bytes between two frames")
            _, length, number, frequency_Hz, amplitude = _HEAD.unpack_from(self._bytes)
            if length != self._size - _LENGTH_BYTES:
                if self._expected is None:
                    raise DeviceError(self._misfit(length), "DEVICE_DATA")
                made, due = length + _LENGTH_BYTES, self._size
                text = f"a frame of {made} bytes, where {self._shape} samples and channels make {due}"
                self._drop(len(_MARK), "BLOCK_SHORT" if made < due else "DEVICE_DATA", text)
                continue
            if (within := self._bytes.find(self._begin_of_frame, 1, self._size)) > 0:
                self._drop(within, "BLOCK_SHORT", f"a frame that ended after {within} of {self._size} bytes")
                continue
            if len(self._bytes) < self._size:
                return None
            samples = np.frombuffer(self._bytes, "<f4", offset=_HEAD.size, count=self._shape[0] * self._shape[1])
            rows = samples.reshape(self._shape).T.astype(np.float64)
            del samples  # it would keep the bytes from being deleted
            del self._bytes[: self._size]
            self._is_short = False
            if self._is_next(number):
                return self._block(rows, frequency_Hz, amplitude)
        if at < 0 and len(self._bytes) >= len(_MARK):
            self._drop(len(self._bytes) - len(_MARK) + 1, "DEVICE_DATA", "bytes without a frame")
        return None

    def _misfit(self, length: int) -> str:
        """The reason why the first frame does not fit, and the line to change."""
        samples, channels = self._shape
        numbers, rest = divmod(length + _LENGTH_BYTES - _HEAD.size, 4)
        remedies: list[str] = []
        if not rest and numbers % samples == 0:
            sent = numbers // samples
            remedies.append(f"set device.channels = {sent}" if sent > channels else f"use no source above {sent - 1}")
        if not rest and numbers % channels == 0:
            remedies.append(f"set converter.samples_per_block = {numbers // channels}")
        remedy = ", or ".join(remedies) or "compare the frames with [converter] and [channels]"
        ours = f"{samples} samples x {channels} channels = {samples * channels}"
        return f"the first frame has {numbers} numbers, the rig file {ours}; {remedy}"

    def _drop(self, count: int, code: str, why: str) -> None:
        if not count:
            return
        del self._bytes[:count]
        if code != "DEVICE_DATA" or not self._is_short:
            self._problems.append((code, f"{why}: dropped"))
        self._is_short = code == "BLOCK_SHORT" or self._is_short

    def _is_next(self, number: int) -> bool:
        """Whether a block continues the count, perhaps after a loss, or begins another one."""
        expected, before = self._expected, self._before
        behind = 0 if expected is None else expected - number
        if behind == 1 or (0 < behind <= _LATE_BLOCKS and number > 0):
            code = "BLOCK_REPEATED" if behind == 1 else "BLOCK_ORDER"
            self._problems.append((code, f"block {number} after block {number + behind - 1}: dropped"))
            return False
        if behind > 0 or (expected is None and before is not None and number < before):
            self._problems.append(("DEVICE_RESTARTED", f"block {number} after block {(expected or before or 1) - 1}"))
        self._lost += max(-behind, 0)
        self._expected = number + 1
        return True

    def _block(self, rows: np.ndarray, frequency_Hz: float, amplitude: float) -> DeviceBlock:
        if not (math.isfinite(frequency_Hz) and math.isfinite(amplitude)):
            frequency_Hz, amplitude = self._written
        block = DeviceBlock(rows, frequency_Hz, amplitude, self._lost, len(self._bytes) // self._size)
        self._lost = 0
        return block

    def problems(self) -> list[tuple[str, str]]:
        """Dropped data, and restarts of the device's count."""
        problems, self._problems = self._problems, []
        return problems

    def enable(self, on: bool, toggle: int) -> None:
        """Set the enable line, sent with the next vibration."""
        self._line = int(on), toggle

    def write(self, frequency_Hz: float, amplitude: float) -> None:
        """Send a command; while the device reads none, the newest waits."""
        self._written = frequency_Hz, amplitude
        command = _COMMAND.pack(_COMMAND_MARK, _COMMAND.size - _LENGTH_BYTES, frequency_Hz, amplitude, *self._line)
        unsent = self._unsent
        try:
            self._unsent = unsent[os.write(self._out, unsent) :] if unsent else unsent
            if not self._unsent:
                self._unsent = command[os.write(self._out, command) :]
        except BlockingIOError:
            raise DeviceError("the device reads no commands") from None
        except OSError as error:
            raise DeviceError(f"the connection is lost: {error.strerror}") from None

    def safe(self) -> None:
        """Send rest."""
        self._line = 0, self._line[1]
        with contextlib.suppress(DeviceError):
            self.write(self._written[0], 0.0)

    def close(self) -> None:
        """Disconnect, and end the program."""
        if self._socket is not None:
            self._socket.close()
        if self._program is not None:
            _end(self._program)
        self._socket, self._program, self._in, self._out = None, None, -1, -1


def _number(pipe: IO[bytes] | None) -> int:
    return -1 if pipe is None else pipe.fileno()


def _end(program: "subprocess.Popen[bytes]") -> None:
    """End a program: it ends by itself once its stdin is closed, else by a signal."""
    for pipe in (program.stdin, program.stdout):
        if pipe is not None:
            with contextlib.suppress(OSError):
                pipe.close()
    try:
        program.wait(_END_S)
    except subprocess.TimeoutExpired:
        program.kill()
        program.wait()
