"""Messages that did not fit into the recorder's inbox."""

import threading
from pathlib import Path
from typing import Any

import pytest

from bridge.log.recorder import _record
from bridge.log.runlog import RunLog
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.complaints import Complaints
from bridge.wire.inbox import Inbox, Received
from bridge.wire.topics import PLANT_EVENT


class NoPeer:
    """A bus without a plant."""

    def alive(self, _role: str) -> bool:
        return False

    def linked(self) -> bool:
        return True


@pytest.mark.slow
def test_messages_that_did_not_fit_are_an_event_of_the_log(tmp_path: Path) -> None:
    events: list[wire.Event] = []
    log = RunLog(tmp_path / "run.mcap", lockstep=False, on_event=events.append)
    inbox = Inbox(1)
    start = wire.Event(source="plant", code="START").SerializeToString()
    for _ in range(4):
        inbox.push(Received(PLANT_EVENT, start, 0))
    stop = threading.Event()
    stop.set()
    bus: Any = NoPeer()
    _record(log, bus, inbox, stop, None, Complaints(log.add_event))
    log.close()
    assert [event.text for event in events if event.code == "DROPPED"] == [
        "inbox: message lost: the recorder was too slow (3 times)"
    ]
