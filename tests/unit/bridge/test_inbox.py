"""Inboxes are bounded, and rare topics have reserved capacity."""

from bridge.wire.inbox import Inbox, Received
from bridge.wire.topics import ANNOUNCE, OPERATOR, SENSORS, Topic


def message(topic: Topic, payload: bytes = b"") -> Received:
    return Received(topic, payload, 0)


def test_overflow_is_dropped_and_counted_by_topic() -> None:
    inbox = Inbox(3)
    for number in range(5):
        inbox.push(message(SENSORS, bytes([number])))
    for _ in range(300):
        inbox.keep(message(OPERATOR))
    for _ in range(10):
        inbox.keep(message(ANNOUNCE))
    assert inbox.dropped == 2 + 44
    assert inbox.dropped_of == {"sensors": 2, "operator": 44}
    came = [received.topic.name for received in iter(inbox.get, None)]
    assert came == ["sensors"] * 3 + ["operator"] * 256 + ["announce"] * 10


def test_reading_frees_capacity() -> None:
    inbox = Inbox(2)
    for number in range(10):
        inbox.push(message(SENSORS, bytes([number])))
        received = inbox.get(1.0)
        assert received is not None
        assert received.payload == bytes([number])
    assert inbox.get(0.0) is None
    assert inbox.dropped == 0
