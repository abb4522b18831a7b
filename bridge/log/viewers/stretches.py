"""Blocks as a few scalars at 200 Hz, in place of messages of 20 samples.

A viewer draws one number a message. The blocks of a stretch of 5 ms become one message with the smallest, mean and largest
sample of each signal. A stretch ends where `t_ns` passes a multiple of 5 ms, whatever the length of a block is.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.log.chunk_messages import Column
from bridge.wire import topics
from bridge.wire.messages import APPLIED, CHANNELS, SCOPE, TRACE, Layout, Records

PERIOD_NS = 5_000_000
_UNIT_AT = {name: name.rindex("_") for name in CHANNELS}
_NAMES = {
    which: [f"{name[: _UNIT_AT[name]]}_{which}{name[_UNIT_AT[name] :]}" for name in CHANNELS]
    for which in ("min", "mean", "max")
}
_OF_APPLIED = ("frequency_Hz", "amplitude_m", "guard_state", "cause")
_OF_TRACE = (
    "vibration_velocity_mps",
    "drive_velocity_mps",
    "wanted_velocity_mps",
    "time_to_slip_s",
    "mode",
    "state",
    "reason",
    "limit",
)


def last_of_stretches(t_ns: Column) -> Column:
    """Which of these messages, in order, are the last of their stretch."""
    return np.flatnonzero(np.diff((t_ns - 1) // PERIOD_NS, append=-1))


class ScopeBlocks(NamedTuple):
    """Blocks, in order."""

    t_ns: Column  # [blocks]
    log_ns: Column  # [blocks]
    samples: npt.NDArray[np.float32]  # [channels, blocks, samples]


class _Latest:
    """The newest used message of one topic, and all messages after it."""

    def __init__(self, layout: Layout, fields: Sequence[str]) -> None:
        self._fields = fields
        self._kept = np.empty(0, layout.dtype)

    def add(self, messages: Records) -> None:
        """Add canonical messages, in order; only the last of each stretch is needed."""
        whole = f"V{messages.dtype.itemsize}"  # numpy joins raw elements in one go, and records field by field
        self._kept = np.concatenate([self._kept.view(whole), messages.view(whole)]).view(messages.dtype)

    def fill(self, records: Records) -> None:
        """Write the fields of the newest message up to the end of each stretch; they stay 0 before the first."""
        messages = self._kept
        newest = np.searchsorted(messages["t_ns"], records["t_ns"], side="right") - 1
        known = slice(int(np.searchsorted(newest, 0)), None)
        for field in self._fields:
            records[field][known] = messages[field][newest[known]]
        self._kept = self._kept[max(int(newest[-1]), 0) :]


class Stretches:
    """Makes the messages of a run, in order."""

    def __init__(self) -> None:
        self._sequence = 0
        self._rest: ScopeBlocks | None = None  # blocks of the unfinished stretch
        self._latest = {
            topics.APPLIED.name: _Latest(APPLIED, _OF_APPLIED),
            topics.TRACE.name: _Latest(TRACE, _OF_TRACE),
        }

    def say(self, topic: str, messages: Records) -> None:
        """Add canonical messages of the topic `applied` or `trace`, in order; the last of each stretch is enough."""
        self._latest[topic].add(messages)

    def made(self, blocks: ScopeBlocks | None, last: bool) -> tuple[Records | None, Column]:
        """Messages of the stretches that end within these blocks, and their log times; None for none.

        A change of the number of samples drops the unfinished stretch. `last`: no block follows, so the last stretch ends too.
        """
        blocks = self._with_the_rest(blocks)
        if blocks is None:
            return None, np.empty(0, np.int64)
        starts = np.flatnonzero(np.diff((blocks.t_ns - 1) // PERIOD_NS, prepend=-1))
        ends = np.append(starts[1:], len(blocks.t_ns))
        self._rest = None
        if not last:  # later messages of the other topics may belong to it
            few = slice(int(starts[-1]), None)
            self._rest = ScopeBlocks(blocks.t_ns[few].copy(), blocks.log_ns[few].copy(), blocks.samples[:, few].copy())
            starts, ends = starts[:-1], ends[:-1]
        if not len(starts):
            return None, ends
        records = SCOPE.blank(len(starts))
        records["sequence"] = self._sequence + np.arange(len(starts), dtype=np.uint64)
        records["t_ns"] = blocks.t_ns[ends - 1]
        self._sequence += len(starts)
        _, count, samples = blocks.samples.shape
        each = blocks.samples.reshape(len(CHANNELS), count * samples)[:, : ends[-1] * samples]
        places = starts * samples
        figures = {
            "min": np.minimum.reduceat(each, places, axis=1),
            "mean": np.add.reduceat(each, places, axis=1) / ((ends - starts) * samples),
            "max": np.maximum.reduceat(each, places, axis=1),
        }
        for which, figure in figures.items():
            for row, field in enumerate(_NAMES[which]):
                records[field] = figure[row]
        for latest in self._latest.values():
            latest.fill(records)
        return records, blocks.log_ns[ends - 1]

    def _with_the_rest(self, blocks: ScopeBlocks | None) -> ScopeBlocks | None:
        before = self._rest
        if blocks is None or before is None or before.samples.shape[2] != blocks.samples.shape[2]:
            return before if blocks is None else blocks
        return ScopeBlocks(
            np.concatenate([before.t_ns, blocks.t_ns]),
            np.concatenate([before.log_ns, blocks.log_ns]),
            np.concatenate([before.samples, blocks.samples], axis=1),
        )
