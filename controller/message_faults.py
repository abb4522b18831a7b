"""Faults of the messages that a controller receives: counted here, published at most once a second for each kind."""

from collections.abc import Callable

from bridge.faults import Fault
from bridge.wire.complaints import BAD_MESSAGE, CLOCK, FLOOD, FOREIGN, Complaints
from bridge.wire.topics import SENSORS, Topic
from bridge.wire.zenoh_link import Inbox
from controller.node import ControllerNode


class MessageFaults:
    """Reports faulty and lost messages, from the counters of node and inbox.

    Args:
        node: the controller.
        inbox: queue of received messages.
        publish: publishes an event with a code and a text.

    """

    def __init__(self, node: ControllerNode, inbox: Inbox, publish: Callable[[str, str], None]) -> None:
        self.complaints = Complaints(publish)
        self._node = node
        self._inbox = inbox
        self._seen: dict[str, int] = {}

    def unreadable(self, topic: Topic, fault: Fault) -> None:
        """Report a message that cannot be read, and was dropped."""
        self.complaints.note(BAD_MESSAGE, topic.name, f"{fault.line.partition(': ')[2]}: dropped")

    def look(self) -> None:
        """Count the faults since the last call, and publish those that are due."""
        node, note = self._node, self.complaints.note
        for topic, dropped in list(self._inbox.dropped_of.items()):
            if new := self._since(f"dropped {topic}", dropped):
                note(FLOOD, topic, "more messages than can be answered: dropped", new)
        if new := self._since("strays", node.strays):
            text = f"blocks with numbers far from the last block {node.last_block}: dropped; is a second rig on this prefix?"
            note(FOREIGN, SENSORS.name, text, new)
        if new := self._since("again", node.duplicates):
            note(
                "REPEATED",
                SENSORS.name,
                "repeated or late blocks: dropped; is a second rig on this prefix?",
                new,
            )
        if node.clock_jump_ns:
            late = f"t_ns is {node.clock_jump_ns * 1e-6:g} ms off the time that the block number gives"
            note(CLOCK, SENSORS.name, f"block {node.last_block}: {late}; trace and log keep the rig's times")
            node.clock_jump_ns = 0
        if node.age.is_late:
            text = (
                f"blocks arrive {node.age.late_ns * 1e-6:.0f} ms later than before: v_a oscillates more than it should"
            )
            note("LATE", SENSORS.name, text)
        self.complaints.report_when_due()

    def _since(self, name: str, count: int) -> int:
        new = count - self._seen.get(name, 0)
        self._seen[name] = count
        return new
