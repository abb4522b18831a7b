"""The adapter `stream` reads whole frames alone, counts lost blocks, and reports dropped data."""

import math
import socket
import struct
import threading
from collections.abc import Generator
from pathlib import Path

import numpy as np
import pytest

from bridge.faults import Fault
from bridge.rig.adapters.stream import Adapter
from bridge.rig.device import DeviceError, Setup
from tests.patience import PATIENCE_S

SAMPLES, CHANNELS = 20, 2
SETUP = Setup({}, Path(), 20_000.0, SAMPLES, CHANNELS, has_enable_line=True)


def frame(number: int, frequency_Hz: float = 2600.0, amplitude: float = 3e-8, samples: int = SAMPLES) -> bytes:
    values = np.arange(samples * CHANNELS, dtype="<f4") + number
    return struct.pack("<4sIQdd", b"SSR1", 24 + 4 * values.size, number, frequency_Hz, amplitude) + values.tobytes()


class Peer:
    """The device's end of the connection."""

    def __init__(self) -> None:
        self.server = socket.create_server(("127.0.0.1", 0))
        address = f"127.0.0.1:{self.server.getsockname()[1]}"
        self.adapter = Adapter(SETUP._replace(settings={"address": address, "waits": True}))
        accepted: list[socket.socket] = []
        thread = threading.Thread(target=lambda: accepted.append(self.server.accept()[0]))
        thread.start()
        self.adapter.open()
        thread.join(PATIENCE_S)
        self.socket = accepted[0]
        self.socket.settimeout(PATIENCE_S)


@pytest.fixture
def peer() -> Generator[Peer]:
    made = Peer()
    yield made
    made.adapter.close()
    made.socket.close()
    made.server.close()


def numbers(peer: Peer, data: bytes, blocks: int) -> list[tuple[int, int, str]]:
    """First sample, lost blocks and reported problems of the next blocks."""
    peer.socket.sendall(data)
    found: list[tuple[int, int, str]] = []
    for _ in range(blocks):
        block = peer.adapter.read()
        assert block is not None
        problems = "; ".join(f"{code} {text}" for code, text in peer.adapter.problems())
        found.append((int(block.samples[0, 0]), block.lost, problems))
    return found


def test_a_frame_is_a_block_in_the_order_of_channels(peer: Peer) -> None:
    peer.socket.sendall(frame(0))
    block = peer.adapter.read()
    assert block is not None
    assert block.samples.shape == (CHANNELS, SAMPLES)
    assert block.samples[1].tolist() == [2.0 * i + 1.0 for i in range(SAMPLES)]
    assert block[1:] == (2600.0, 3e-8, 0, 0)


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (frame(0) + frame(1), [(0, 0, ""), (1, 0, "")]),
        (frame(0) + frame(4) + frame(5), [(0, 0, ""), (4, 3, ""), (5, 0, "")]),
        (frame(0) + frame(0) + frame(1), [(0, 0, ""), (1, 0, "BLOCK_REPEATED block 0 after block 0: dropped")]),
        (
            frame(0) + frame(2) + frame(1) + frame(3),
            [(0, 0, ""), (2, 1, ""), (3, 0, "BLOCK_ORDER block 1 after block 2: dropped")],
        ),
        (b"\xff" * 100 + frame(0), [(0, 0, "DEVICE_DATA 100 bytes between two frames: dropped")]),
        (b"SSR" + frame(0), [(0, 0, "DEVICE_DATA 3 bytes between two frames: dropped")]),
        (
            frame(0)[:150] + frame(1) + frame(2),
            [(1, 0, "BLOCK_SHORT a frame that ended after 150 of 192 bytes: dropped"), (2, 0, "")],
        ),
        (
            frame(900) + frame(0) + frame(1),
            [(900, 0, ""), (0, 0, "DEVICE_RESTARTED block 0 after block 900"), (1, 0, "")],
        ),
    ],
)
def test_lost_repeated_and_broken_frames_are_counted(
    peer: Peer, data: bytes, expected: list[tuple[int, int, str]]
) -> None:
    assert numbers(peer, data, len(expected)) == expected


def test_a_frame_of_another_length_is_dropped_with_both_lengths(peer: Peer) -> None:
    _, (first, lost, dropped) = numbers(peer, frame(0) + frame(1, samples=10) + frame(2), 2)
    assert (first, lost) == (2, 1)
    assert dropped == "BLOCK_SHORT a frame of 112 bytes, where (20, 2) samples and channels make 192: dropped"


@pytest.mark.parametrize(
    ("samples", "line"),
    [
        (
            40,
            "80 numbers, the rig file 20 samples x 2 channels = 40; set device.channels = 4, or set converter.",
        ),
        (10, "20 .*= 40; use no source above 0, or set converter.samples_per_block = 10"),
        (15, "30 .*= 40; set converter.samples_per_block = 15"),
    ],
)
def test_a_first_frame_that_does_not_fit_names_the_line_to_change(peer: Peer, samples: int, line: str) -> None:
    peer.socket.sendall(frame(0, samples=samples))
    with pytest.raises(DeviceError, match=f"the first frame has {line}") as error:
        peer.adapter.read()
    assert error.value.code == "DEVICE_DATA"


def test_a_device_may_have_more_channels_than_the_rig_file_uses(peer: Peer) -> None:
    settings = {"address": peer.adapter._settings.address, "waits": True, "channels": CHANNELS + 1}
    adapter = Adapter(SETUP._replace(settings=settings))
    adapter.open()
    with peer.server.accept()[0] as device:
        values = np.arange(SAMPLES * (CHANNELS + 1), dtype="<f4")
        device.sendall(struct.pack("<4sIQdd", b"SSR1", 24 + values.nbytes, 0, 2600.0, 0.0) + values.tobytes())
        block = adapter.read()
    adapter.close()
    assert block is not None
    assert block.samples[:, 1].tolist() == [3.0, 4.0, 5.0]


def test_a_device_that_does_not_know_its_vibration_gets_the_written_one(peer: Peer) -> None:
    peer.adapter.enable(on=True, toggle=1)
    peer.adapter.write(2500.0, 2e-8)
    mark, length, *command = struct.unpack("<4sIddII", peer.socket.recv(1 << 10))
    assert (mark, length, command) == (b"SSC1", 24, [2500.0, 2e-8, 1, 1])
    peer.socket.sendall(frame(0, math.nan, math.nan))
    block = peer.adapter.read()
    assert block is not None
    assert (block.frequency_Hz, block.amplitude) == (2500.0, 2e-8)


def test_blocks_that_wait_are_counted(peer: Peer) -> None:
    peer.socket.sendall(b"".join(frame(number) for number in range(5)))
    waiting = [block.waiting for _ in range(5) if (block := peer.adapter.read()) is not None]
    assert waiting == [4, 3, 2, 1, 0]


def test_a_device_that_another_client_holds_is_an_error(peer: Peer) -> None:
    peer.socket.close()
    with pytest.raises(DeviceError, match="before its first block: another client may hold the device") as error:
        peer.adapter.read()
    assert error.value.code == "DEVICE_BUSY"


def test_a_device_that_leaves_is_another_error(peer: Peer) -> None:
    numbers(peer, frame(0), 1)
    peer.socket.close()
    with pytest.raises(DeviceError, match="the device ended the connection") as error:
        peer.adapter.read()
    assert error.value.code == "DEVICE_GONE"


def test_a_device_that_reads_no_commands_is_an_error(peer: Peer) -> None:
    def flood() -> None:
        for _ in range(1_000_000):
            peer.adapter.write(2500.0, 2e-8)

    with pytest.raises(DeviceError, match="reads no commands"):
        flood()


def test_a_device_that_is_not_there_is_an_error_at_its_opening() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    with pytest.raises(DeviceError, match=rf"127.0.0.1:{port}: Connection refused"):
        Adapter(SETUP._replace(settings={"address": f"127.0.0.1:{port}"})).open()
    with pytest.raises(DeviceError, match="no-such-program: No such file"):
        Adapter(SETUP._replace(settings={"command": ["./no-such-program"]})).open()


def test_a_program_is_started_and_ends_with_the_connection(tmp_path: Path) -> None:
    values = ", ".join(str(float(i)) for i in range(SAMPLES * CHANNELS))
    (tmp_path / "rig.py").write_text(
        "import struct, sys\n"
        f"head = struct.pack('<4sIQdd', b'SSR1', {24 + 4 * SAMPLES * CHANNELS}, 0, 1.0, 0.0)\n"
        f"sys.stdout.buffer.write(head + struct.pack('<{SAMPLES * CHANNELS}f', {values}))\n"
        "sys.stdout.flush()\n"
        "sys.stdin.read()\n"
    )
    settings = {"command": ["python3", "rig.py"], "waits": True}
    adapter = Adapter(SETUP._replace(settings=settings, folder=tmp_path))
    adapter.open()
    block = adapter.read()
    assert block is not None
    assert block.samples[0, 1] == 2.0
    program = adapter._program
    assert program is not None
    adapter.close()
    assert program.returncode == 0


@pytest.mark.parametrize(
    ("settings", "line"),
    [
        ({}, "address, command: neither given: must be one"),
        ({"address": "here:1", "command": ["x"]}, "address, command: both given"),
        ({"address": "here"}, "address = 'here': must be HOST:PORT"),
        (
            {"address": "here:1", "channels": 1},
            "device.channels = 1: must be 2 or more, as the rig file has source = 1",
        ),
        ({"adress": "here:1"}, "adress = 'here:1': unknown key; perhaps address"),
    ],
)
def test_wrong_settings_are_one_line(settings: dict[str, object], line: str) -> None:
    with pytest.raises(Fault, match=line):
        Adapter(SETUP._replace(settings=settings))
