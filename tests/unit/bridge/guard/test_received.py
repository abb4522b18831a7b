"""Invalid commands are dropped, counted and reported; the controller's commands pass."""

import math

import pytest

from bridge.guard.received import CommandQueue
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.complaints import Complaints
from bridge.wire.inbox import WAITING, Received
from bridge.wire.topics import COMMAND


def commands() -> tuple[CommandQueue, list[str]]:
    complaints: list[str] = []
    return CommandQueue(Complaints(lambda code, text: complaints.append(f"{code} {text}"))), complaints


def command(block: int, amplitude_m: float = 3e-8, frequency_Hz: float = 2600.0) -> Received:
    payload = wire.Command(block=block, amplitude_m=amplitude_m, frequency_Hz=frequency_Hz).SerializeToString()
    return Received(COMMAND, payload, 0)


def test_an_answer_to_a_past_block_passes() -> None:
    made, complaints = commands()
    for block in (5, 6, 6, 9):
        made.push(command(block))
    assert [answered for _, answered in made.take(10)] == [5, 6, 6, 9]
    assert made.take(11) == []
    assert complaints == []


@pytest.mark.parametrize(
    ("amplitude_m", "frequency_Hz"),
    [
        (math.nan, 2600.0),
        (math.inf, 2600.0),
        (-1e-9, 2600.0),
        (1e300, 2600.0),
        (1e-8, math.nan),
        (1e-8, math.inf),
        (1e-8, -1.0),
    ],
)
def test_an_invalid_amplitude_or_frequency_is_dropped(amplitude_m: float, frequency_Hz: float) -> None:
    made, complaints = commands()
    for _ in range(100):
        made.push(command(9, amplitude_m, frequency_Hz))
    made.push(command(9))
    assert [answered for _, answered in made.take(10)] == [9]
    assert len(complaints) == 1
    assert complaints[0].startswith("BAD_MESSAGE command amplitude: ")


def test_blocks_to_come_and_blocks_long_past_are_dropped() -> None:
    made, complaints = commands()
    for block in (9, 10, 2**63, 2**64 - 1, 3, 8):
        made.push(command(block))
    assert [answered for _, answered in made.take(10)] == [9]
    assert complaints == [
        "FOREIGN command ahead: answers block 10, which is still to come after block 9: dropped",
        "FOREIGN command behind: answers block 3, after block 9 was answered: dropped",
    ]


def test_rubbish_is_dropped() -> None:
    made, complaints = commands()
    made.push(Received(COMMAND, b"\xff" * 12, 0))
    made.push(Received(COMMAND, b"\xff" * 100_000, 0))
    assert made.take(10) == []
    assert complaints[0].startswith("BAD_MESSAGE command: 12 bytes cannot be decoded as Command")


def test_the_newest_commands_of_a_flood_are_read_and_the_dropped_ones_reported() -> None:
    made, complaints = commands()
    for _ in range(WAITING + 744):
        made.push(command(3))
    made.push(command(9))
    assert [answered for _, answered in made.take(10)][-1] == 9
    assert complaints == ["FLOOD command: too many for one block: the oldest were dropped (745 times)"]
    assert made.take(11) == []
    assert len(complaints) == 1
