"""Filter of the log: only messages whose numbers continue are written. Others are counted, reported and dropped."""

from bridge.faults import Fault
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.complaints import BAD_MESSAGE, FOREIGN, BlockNumbers, Complaints, NumberCheck
from bridge.wire.inbox import Received
from bridge.wire.payloads import parsed, sequence_and_time

_HELD = 7  # messages held back whose numbers do not continue; the eighth confirms the new count, and all are written


class Screen:
    """Judges the messages of the bus, topic by topic.

    Args:
        complaints: reports the dropped messages.

    """

    def __init__(self, complaints: Complaints) -> None:
        self._complaints = complaints
        self._numbers: dict[str, BlockNumbers] = {}
        self._held: dict[str, list[Received]] = {}
        self._lengths: dict[str, int] = {}  # length of the last message that was parsed, by topic

    def passed(self, received: Received) -> list[Received]:
        """The messages to write now: this message, none, or this message after those held until its count was confirmed."""
        topic = received.topic
        try:
            self._check(received)
            if not topic.rate_Hz:  # events and announcements are rare, and their senders may restart the count
                return [received]
            sequence, _ = sequence_and_time(received.payload, topic.message)
        except Fault as fault:
            self.unreadable(received, fault)
            return []
        numbers = self._numbers.setdefault(topic.name, BlockNumbers())
        before, strays = numbers.expected, numbers.strays
        verdict = numbers.judge(sequence, received.arrival_ns)
        if numbers.strays > strays:
            text = f"numbers far from {(before or 0) - 1}: not written; is a second sender on this prefix?"
            self._complaints.note(FOREIGN, topic.name, text, numbers.strays - strays)
        held = self._held.setdefault(topic.name, [])
        if verdict is NumberCheck.STRAY:
            held.append(received)
            del held[:-_HELD]
            return []
        accepted = [*held, received] if verdict is not NumberCheck.AGAIN and numbers.jumped else [received]
        if verdict is not NumberCheck.AGAIN:
            held.clear()
        return accepted

    def _check(self, received: Received) -> None:
        """Raise Fault BAD_MESSAGE unless it is a message of its topic; a message as long as the previous one is not parsed.

        A re-established link may deliver the first messages under a wrong key.
        """
        name, length = received.topic.name, len(received.payload)
        if received.topic.rate_Hz and self._lengths.get(name) == length:
            return
        message = parsed(received.topic.message, received.payload, name)
        if isinstance(message, wire.Event) and not message.code:
            raise Fault("BAD_MESSAGE", f"{name}: an event without a code")
        if isinstance(message, wire.Announce) and message.holds_from_ns < message.t_ns:
            raise Fault("BAD_MESSAGE", f"{name}: announces a time in the past")
        self._lengths[name] = length

    def unreadable(self, received: Received, fault: Fault) -> None:
        """Report and drop a message that cannot be read."""
        self._complaints.note(BAD_MESSAGE, received.topic.name, f"{fault.line.partition(': ')[2]}: not written")
