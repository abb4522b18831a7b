"""Completeness of a log: missing blocks and messages, and jumps of the clock."""

from typing import NamedTuple

from bridge.log.check.log_check import LogWatch
from bridge.log.damage import Damage
from bridge.units import counted
from cockpit.judge.setup import Setup
from cockpit.judge.watches import StepWatch

_OF_EVERY_BLOCK = ("applied", "command", "trace")


class Losses(NamedTuple):
    """Losses of one log."""

    planned_s: float  # planned length if the log ends earlier and without the plant's END; else 0
    blocks: int  # missing blocks
    at_the_end: int  # part of `blocks` after the last block in the log, by the plant's END
    blocks_known: bool  # False: a cut or damaged log may lack more
    messages: int  # missing messages, blocks included
    absent: list[str]  # topics without any message that should have one per block
    misses_known: bool  # False: the log lacks steps of the controller, so it may have missed more blocks


def losses_of(log: LogWatch, steps: StepWatch, setup: Setup, damage: Damage, seconds: float) -> Losses:
    """Losses of a log that ends at `seconds`.

    A damaged chunk may contain the first or the last blocks: then the number in the plant's END counts.
    """
    blocks, sent, topics = log.topics["sensors"], log.events.blocks_sent, log.topics
    early = seconds < setup.duration_s - 0.5 * setup.block_s and not log.events.has("plant", "END")
    at_the_end = max((sent or 0) - blocks.end, 0)
    lost, known = blocks.missing, damage.whole and not damage.before
    if sent is not None:  # the recorder may have started late
        lost, known = lost + (0 if known else blocks.first_number) + at_the_end, True
    return Losses(
        planned_s=setup.duration_s if early else 0.0,
        blocks=lost,
        at_the_end=at_the_end,
        blocks_known=known,
        messages=lost + sum(topics[name].missing for name in (*_OF_EVERY_BLOCK, "state")),
        absent=[name for name in _OF_EVERY_BLOCK if not (setup.imported or topics[name].messages)],
        # a gap is reported only by the step after it
        misses_known=topics["trace"].missing == 0 and steps.last_block >= max(blocks.end, sent or 0) - 1,
    )


def clock_fault(log: LogWatch) -> str:
    """Fault of the block times, in words; empty if the times follow the block numbers."""
    watch = log.topics["sensors"]
    if not watch.jumps:
        return ""
    number, where = (watch.standing, "is constant") if watch.standing > watch.jumps // 2 else (watch.jumps, "jumps")
    first, off_ns = watch.first_jump
    times = f"{where} at {counted(number, 'block')}, first {first} by {off_ns * 1e-6:g} ms: times are wrong from there"
    return f"CLOCK: t_ns of /sensors {times}"
