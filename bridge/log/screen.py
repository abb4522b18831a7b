"""Which messages go into a log: those whose numbers go on. A stranger's are counted, told and left out."""

from bridge.faults import Fault
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.block_numbers import BlockNumbers, Verdict
from bridge.wire.complaints import BAD_MESSAGE, FOREIGN, Complaints
from bridge.wire.inbox import Received
from bridge.wire.payloads import parsed, sequence_and_time

_HELD = 7  # messages of another count that are kept: they are written where the eighth makes that count believed


class Screen:
    """Judges what comes from the bus, topic by topic.

    Args:
        complaints: where what is wrong is told.

    """

    def __init__(self, complaints: Complaints) -> None:
        self._complaints = complaints
        self._numbers: dict[str, BlockNumbers] = {}
        self._held: dict[str, list[Received]] = {}
        self._lengths: dict[str, int] = {}  # of the last message that was read, by topic

    def passed(self, received: Received) -> list[Received]:
        """What is to be written now: the message, nothing, or with it those that were held until its count was believed."""
        topic = received.topic
        try:
            self._check(received)
            if not topic.rate_Hz:  # events and announcements are rare, and their senders may begin anew
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
        if verdict is Verdict.STRAY:
            held.append(received)
            del held[:-_HELD]
            return []
        believed = [*held, received] if verdict is not Verdict.AGAIN and numbers.jumped else [received]
        if verdict is not Verdict.AGAIN:
            held.clear()
        return believed

    def _check(self, received: Received) -> None:
        """Raise Fault BAD_MESSAGE for what is no message of its topic; one that is as long as the last one is not parsed.

        A link that is made anew may hand over the first messages under a wrong key.
        """
        name, length = received.topic.name, len(received.payload)
        if received.topic.rate_Hz and self._lengths.get(name) == length:
            return
        message = parsed(received.topic.message, received.payload, name)
        if isinstance(message, wire.Event) and not message.code:
            raise Fault("BAD_MESSAGE", f"{name}: an event without a code")
        if isinstance(message, wire.Announce) and message.holds_from_ns < message.t_ns:
            raise Fault("BAD_MESSAGE", f"{name}: announces what is past")
        self._lengths[name] = length

    def unreadable(self, received: Received, fault: Fault) -> None:
        """A message cannot be read, and is left out."""
        self._complaints.note(BAD_MESSAGE, received.topic.name, f"{fault.line.partition(': ')[2]}: not written")
