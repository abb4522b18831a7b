"""Messages are read by a walk through the records of a chunk; its message indexes do not matter."""

import struct

import pytest

from bridge.log.chunk_messages import Chunked, messages_of

_PAYLOADS = [(1, b"a" * 20), (2, b"bb"), (1, b"c" * 20), (3, b""), (1, b"d" * 20)]


def _record(channel: int, number: int, payload: bytes) -> bytes:
    return struct.pack("<BQHIQQ", 5, 22 + len(payload), channel, number, 1000 + number, 2000 + number) + payload


def _chunk(payloads: list[tuple[int, bytes]], first: bytes = b"") -> tuple[bytes, list[bytes]]:
    """The records of a chunk, after those that are in `first`; and its indexes."""
    data = first
    entries: dict[int, bytes] = {}
    for number, (channel, payload) in enumerate(payloads):
        entries[channel] = entries.get(channel, b"") + struct.pack("<QQ", 1000 + number, len(data))
        data += _record(channel, number, payload)
    return data, [struct.pack("<HI", channel, len(body)) + body for channel, body in entries.items()]


def _messages(chunks: list[Chunked]) -> list[tuple[int, int, bytes]]:
    messages = messages_of(chunks)
    return list(zip(messages.channel.tolist(), messages.heads["sequence"].tolist(), messages.payloads(), strict=True))


DATA, INDEXES = _chunk(_PAYLOADS)
EXPECTED = [(channel, number, payload) for number, (channel, payload) in enumerate(_PAYLOADS)]
OTHER = _chunk([(1, b"x" * 20)] * 5)[1]


@pytest.mark.parametrize(
    "indexes",
    [
        INDEXES,
        INDEXES[::-1],
        [],
        INDEXES[:1],
        [*INDEXES, INDEXES[0]],
        [INDEXES[0][:-3], *INDEXES[1:]],
        OTHER,
        [struct.pack("<HIQQ", 1, 16, 0, offset) for offset in (2**63, 2**64 - 1, len(DATA), 3)],
    ],
    ids=["right", "in another order", "none", "one lost", "one twice", "cut", "of another chunk", "out of the chunk"],
)
def test_a_wrong_index_changes_nothing(indexes: list[bytes]) -> None:
    assert _messages([Chunked(DATA, indexes)]) == EXPECTED
    assert _messages([Chunked(DATA, INDEXES), Chunked(DATA, indexes)]) == EXPECTED * 2


def test_other_records_in_a_chunk_are_passed_over() -> None:
    data, indexes = _chunk(_PAYLOADS, struct.pack("<BQ3s", 4, 3, b"any"))
    assert _messages([Chunked(data, indexes)]) == EXPECTED
    assert _messages([Chunked(data, []), Chunked(b"", [])]) == EXPECTED


def test_a_message_does_not_go_on_in_the_next_chunk() -> None:
    """The last message of the first chunk claims more bytes than it has; together with the next chunk it has them."""
    broken = (
        DATA[: -len(_record(1, 4, b"d" * 20))] + struct.pack("<BQHIQQ", 5, 22 + 20 + len(DATA), 1, 4, 0, 0) + b"d" * 20
    )
    assert _messages([Chunked(broken, INDEXES), Chunked(DATA, [])]) == [*EXPECTED[:-1], *EXPECTED]


def test_messages_of_one_channel_keep_their_order() -> None:
    messages = messages_of([Chunked(DATA, INDEXES)] * 2)
    assert sorted(messages.by_channel) == [1, 2, 3]
    for mine in (messages.of([1]), messages.by_channel[1]):
        assert mine.heads["sequence"].tolist() == [0, 2, 4] * 2
        assert mine.payloads(2) == [b"a" * 20, b"c" * 20]
        assert mine.stacked is not None
        assert mine.stacked.tobytes() == 2 * (b"a" * 20 + b"c" * 20 + b"d" * 20)
    assert messages.of([1, 2]).heads["sequence"].tolist() == [0, 1, 2, 4] * 2
    assert messages.stacked is None
