"""Inboxes are bounded, and rare topics have reserved capacity."""

import threading
from types import SimpleNamespace

import pytest

from bridge.wire import inbox as module
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


def test_a_wait_ends_at_its_time_though_the_process_stalls_after_a_message_that_needed_no_wait(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """`queue.SimpleQueue` waits for ever here: the process of a rig did, and its exciter rested by the device's watchdog."""
    inbox, came = Inbox(2), []
    inbox.push(message(SENSORS))
    assert inbox.get() is not None
    times_s = iter([0.0, 0.0, 9.0])  # the wait begins, and goes on after a stall of 9 s
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: next(times_s)))
    thread = threading.Thread(target=lambda: came.append(inbox.get(0.5)), daemon=True)
    thread.start()
    thread.join(5.0)
    assert came == [None]
