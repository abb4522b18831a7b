"""What is wrong with a run as its log tells it: lost or changed bytes, events, a clock that jumps or stands."""

from collections import Counter

import numpy as np

from bridge.log.damage import damage_findings, foreign_in_words
from bridge.log.finding import Finding
from bridge.log.logfile import RunData
from bridge.log.storage.chain import chain_findings
from bridge.units import counted
from bridge.wire.event_codes import WEAK_REASONS, harms, is_told

_MOST_EVENTS = 20  # of one code that are told one by one
_CLOCK_TOLERANCE_NS = 1000  # rounding to whole nanoseconds is far below
_COUNTED_ELSEWHERE = {"NOT_FINITE", "DRIVE_UNSEEN", *WEAK_REASONS}  # from the blocks and steps themselves


def of_bytes(run: RunData) -> list[Finding]:
    """What is wrong with the bytes of a log: what is lost, and what was changed."""
    return [*damage_findings(run.damage, run.path), *chain_findings(run.chain, run.path.name)]


def of_events(run: RunData) -> tuple[list[str], list[str]]:
    """What the events say that is a fault, and what else should be told; of many of one code the first ones."""
    faults: list[str] = []
    told: list[str] = []
    counts: Counter[str] = Counter()
    for event in run.events:
        if event.code in _COUNTED_ELSEWHERE or not is_told(event.code):
            continue
        counts[event.code] += 1
        if counts[event.code] <= _MOST_EVENTS:
            (faults if harms(event.code) else told).append(f"{event.code}: {event.text}")
    for code, count in counts.items():
        if count > _MOST_EVENTS:
            (faults if harms(code) else told).append(f"{code}: and {count - _MOST_EVENTS} more")
    return faults, [*told, *foreign_in_words(run.foreign)]


def of_clock(run: RunData, block_s: float) -> str | None:
    """What is wrong with the time of the blocks, in words; None where it follows their numbers."""
    t_ns, numbers = run.sensors["t_ns"].astype(np.int64), run.sensors["sequence"].astype(np.int64)
    step = np.diff(numbers)
    off_ns = np.diff(t_ns) - step * round(block_s * 1e9)
    wrong = np.flatnonzero((step > 0) & (np.abs(off_ns) > _CLOCK_TOLERANCE_NS))
    if not len(wrong):
        return None
    stands = int(np.count_nonzero((np.diff(t_ns) == 0) & (step > 0)))
    how = (
        f"stands at {counted(stands, 'block')}"
        if stands > len(wrong) // 2
        else f"jumps at {counted(len(wrong), 'block')}"
    )
    first = int(numbers[1:][wrong[0]])
    return f"CLOCK: t_ns of /sensors {how}, first {first} by {off_ns[wrong[0]] * 1e-6:g} ms: times are wrong from there"
