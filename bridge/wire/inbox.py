"""Bounded queues between the receiving threads of the bus and a loop; messages that do not fit are dropped and counted."""

import collections
import contextlib
import threading
import time
from collections.abc import Generator
from typing import NamedTuple

from bridge.wire import clock
from bridge.wire.topics import Topic

# Blocks or commands that may wait during a stall of the loop: at least 1500, the blocks of 1 ms in one lease, as a longer stall
# ends the link. With 512 the controller loses 755 blocks in four stops of 0.7 to 0.9 s, with 4096 none in 24 such stops.
# Larger: a controller that floods its rig delays a block by more than 16 ms, at 4 us a command.
WAITING = 4096
# Rare messages of one topic that may wait. Too small: a burst of announcements is lost. Larger: a flood of one topic delays the
# next block for longer; 256 messages delay it by less than 1 ms.
_KEPT = 256


class Received(NamedTuple):
    """One received message."""

    topic: Topic
    payload: bytes
    arrival_ns: int  # time.perf_counter_ns


class _Counts:
    """Counts of messages of one kind, added and taken: only one thread writes each count, so they need no lock."""

    def __init__(self, limit: int) -> None:
        self.limit = limit
        self.added = 0
        self.taken = 0


class Inbox:
    """A bounded queue between a receiving thread and a loop; a message that does not fit is dropped and counted.

    Args:
        limit: messages of `push` that may wait, of all topics together.
        patient: wait instead of dropping, which blocks the sender: for lockstep, where no message may be lost or is ever late.

    """

    def __init__(self, limit: int, patient: bool = False) -> None:
        self.dropped = 0
        self.dropped_of: dict[str, int] = {}  # number of dropped messages by topic
        self._patient = patient
        self._pushed = _Counts(limit)
        self._kept: dict[str, _Counts] = {}
        self._waiting: collections.deque[tuple[_Counts, Received]] = collections.deque()
        self._arrived = threading.Lock()  # released for each message
        self._arrived.acquire()

    def push(self, received: Received) -> None:
        """Add a message; called by receiving threads."""
        self._add(self._pushed, received)

    def keep(self, received: Received) -> None:
        """Add a rare message: 256 of each topic may wait in addition to the messages of `push`."""
        name = received.topic.name
        if name not in self._kept:
            self._kept[name] = _Counts(_KEPT)
        self._add(self._kept[name], received)

    def _add(self, counts: _Counts, received: Received) -> None:
        while self._patient and counts.added - counts.taken >= counts.limit:
            time.sleep(0.001)
        if counts.added - counts.taken >= counts.limit:
            self.dropped += 1
            self.dropped_of[received.topic.name] = self.dropped_of.get(received.topic.name, 0) + 1
        else:
            counts.added += 1
            self._waiting.append((counts, received))
            if self._arrived.locked():
                with contextlib.suppress(RuntimeError):  # another thread released it
                    self._arrived.release()

    def next(self, timeout_s: float) -> Generator[clock.Wait, None, Received | None]:
        """The oldest message, or None, after a wait of at most `timeout_s` of a loop."""
        if not clock.time.is_simulated:
            return self.get(timeout_s)
        if not self._waiting and timeout_s:
            yield clock.Wait(timeout_s, hears=True)
        return self.get()

    def get(self, timeout_s: float = 0.0) -> Received | None:
        """The oldest message; None if none waits or arrives within `timeout_s`."""
        if timeout_s > 0.0:
            until_s = time.monotonic() + timeout_s
            # `queue.SimpleQueue.get` (Python 3.11) may wait for ever after a stall: its remaining time becomes negative
            while not self._waiting and (left_s := until_s - time.monotonic()) > 0.0:
                self._arrived.acquire(timeout=left_s)
        if not self._waiting:
            return None
        counts, received = self._waiting.popleft()
        counts.taken += 1
        return received
