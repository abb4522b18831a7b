"""What is wrong with received messages, told at most once a second for each kind, with how many there were.

A client that sends rubbish 60 000 times a second must neither end a process nor fill its log, and must not go unsaid.
"""

from collections.abc import Callable
from dataclasses import dataclass

from bridge.wire.clock import time

_EVERY_S = 1.0  # between two events of one kind; shorter: a flood fills logs and screens

# codes of the events
BAD_MESSAGE = "BAD_MESSAGE"  # bytes that are no such message, too many of them, or numbers that mean nothing
FOREIGN = "FOREIGN"  # a good message that none of the known processes can have sent
FLOOD = "FLOOD"  # more messages than can be read
CLOCK = "CLOCK"  # t_ns does not follow the numbers of the blocks


@dataclass
class _Kind:
    """One kind of complaint: a code and a place."""

    text: str = ""
    times: int = 0
    untold: int = 0
    told_s: float = -_EVERY_S


class Complaints:
    """Counts what is wrong and tells it.

    Args:
        tell: publishes an event with a code and a text.
        clock: the time [s]; that of the process if not given.

    """

    def __init__(self, tell: Callable[[str, str], object], clock: Callable[[], float] | None = None) -> None:
        self._tell = tell
        self._clock = clock or time.monotonic
        self._kinds: dict[tuple[str, str], _Kind] = {}
        self._untold = False

    def note(self, code: str, where: str, text: str, times: int = 1) -> None:
        """Something is wrong, `times` times: told now, or with what follows within the second.

        Args:
            code: of the event.
            where: with the code, the kind; one of a few, never a received text.
            text: what is wrong and what becomes of it.
            times: how often.

        """
        kind = self._kinds.setdefault((code, where), _Kind())
        kind.text = text
        kind.times += times
        kind.untold += times
        self._untold = True
        self._tell_one(code, where, kind)

    def tell_when_due(self, all_of_it: bool = False) -> None:
        """Tell what has been kept back for a second, or all that is untold, at an end."""
        if not self._untold:
            return
        self._untold = False
        for (code, where), kind in self._kinds.items():
            if kind.untold:
                self._tell_one(code, where, kind, all_of_it)
                self._untold = self._untold or kind.untold > 0

    def _tell_one(self, code: str, where: str, kind: _Kind, at_once: bool = False) -> None:
        now_s = self._clock()
        if not at_once and now_s - kind.told_s < _EVERY_S:
            return
        count = f" ({kind.untold} times, {kind.times} in all)" if kind.times > kind.untold else f" ({kind.times} times)"
        count = count if kind.times > 1 else ""
        kind.untold, kind.told_s = 0, now_s
        self._tell(code, f"{where}: {kind.text}{count}")
