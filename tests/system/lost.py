"""The messages that a log reports as lost: a computer that stalls for longer than the lease of a link loses some."""

import re
from collections import Counter
from collections.abc import Iterable

from bridge.wire import stickslip_pb2 as wire

_GAP = re.compile(r"(/\S+): (\d+) lost before \d+")


def lost_of(events: Iterable[wire.Event]) -> Counter[str]:
    """Messages that were lost, by topic; none on a computer that does not stall."""
    gaps = (_GAP.fullmatch(event.text) for event in events if event.code == "GAP")
    return sum((Counter({gap[1]: int(gap[2])}) for gap in gaps if gap), Counter())
