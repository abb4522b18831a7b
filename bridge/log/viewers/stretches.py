"""Blocks as a few scalars at 200 Hz, in place of messages of 20 samples: for viewers of a log and for the live page.

A viewer draws one number a message. The blocks of a stretch of 5 ms become one message with the smallest, mean and largest
sample of each signal. A stretch ends where `t_ns` passes a multiple of 5 ms, whatever the length of a block is.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.arrays import Floats, Indices, Records
from bridge.log.chunk_messages import Column
from bridge.wire import topics
from bridge.wire.channels import CHANNELS
from bridge.wire.messages import APPLIED, SCOPE, TRACE, Layout

PERIOD_NS = 5_000_000
# Most messages of a topic that wait for their block: 4 s. A controller whose rig is silent repeats itself at 1 kHz.
_WAIT = 4096
_OF_BOTH = {"sequence", "t_ns"}  # fields of every message


class Envelope(NamedTuple):
    """Smallest, mean and largest value of each group of neighbouring samples."""

    least: Floats
    mean: Floats
    most: Floats


def envelope_of(values: Floats, starts: Indices) -> Envelope:
    """Smallest, mean and largest value of each group along the last axis; `starts`: the first index of each group.

    A sample that is not a number makes all three NaN; the mean is NaN or infinite too where the sum is.
    """
    counts = np.diff(starts, append=values.shape[-1])
    with np.errstate(invalid="ignore", over="ignore"):  # a corrupted block holds inf, -inf or 3e38
        return Envelope(
            np.minimum.reduceat(values, starts, axis=-1),
            np.add.reduceat(values, starts, axis=-1) / counts,
            np.maximum.reduceat(values, starts, axis=-1),
        )


def fields_of(channel: str) -> list[str]:
    """Fields of `Scope` for a channel: `drive_force_min_N`, `drive_force_mean_N` and `drive_force_max_N`."""
    at = channel.rindex("_")
    return [f"{channel[:at]}_{which}{channel[at:]}" for which in ("min", "mean", "max")]


def last_of_stretches(t_ns: Column) -> Column:
    """Indices of the messages that are the last of their stretch; `t_ns`: times of the messages, in order."""
    return np.flatnonzero(np.diff((t_ns - 1) // PERIOD_NS, append=-1))


class ScopeBlocks(NamedTuple):
    """The samples of sensor blocks, in order."""

    t_ns: Column  # [blocks]
    log_ns: Column  # [blocks]
    samples: npt.NDArray[np.float32]  # [channels, blocks, samples]


class _Latest:
    """The newest used message of one topic, and all messages after it."""

    def __init__(self, layout: Layout, fields: set[str]) -> None:
        self._fields = sorted(fields & {*(layout.dtype.names or ())} - _OF_BOTH)
        self._kept = np.empty(0, layout.dtype)

    def add(self, messages: Records) -> None:
        """Add canonical messages, in order; only the last of each stretch is needed."""
        raw = f"V{messages.dtype.itemsize}"  # numpy joins raw elements whole, and records field by field
        self._kept = np.concatenate([self._kept.view(raw), messages.view(raw)]).view(messages.dtype)[-_WAIT:]

    def fill(self, records: Records, fresh_ns: int | None) -> None:
        """Write the fields of the newest message up to the end of each stretch; they stay 0 before the first message.

        `fresh_ns`: the fields are NaN if the newest message is older than this at the end of the stretch.
        """
        messages = self._kept
        # without blocks a controller continues its clock, which the next block sets back
        t_ns = np.minimum.accumulate(messages["t_ns"][::-1])[::-1]
        newest = np.searchsorted(t_ns, records["t_ns"], side="right") - 1
        known = newest >= 0
        if fresh_ns is not None and len(messages):
            known &= t_ns[newest] > records["t_ns"] - fresh_ns
        for field in self._fields:
            if fresh_ns is not None:
                records[field] = np.nan
            records[field][known] = messages[field][newest[known]]
        self._kept = self._kept[max(int(newest[-1]), 0) :]


class Stretches:
    """Makes one message for each stretch of a run, in order.

    Args:
        blank: makes records with the fields of `Scope`, and possibly further ones of `Applied` and `Trace`.
        period_ns: length of a stretch.
        behind: newest stretches held back; messages that belong to their blocks may still arrive.
        fresh_ns: age above which a message of `applied` or `trace` is not used; None: the newest one is used.

    """

    def __init__(
        self,
        blank: Callable[[int], Records] = SCOPE.blank,
        period_ns: int = PERIOD_NS,
        behind: int = 1,
        fresh_ns: int | None = None,
    ) -> None:
        self._blank, self._period_ns, self._behind, self._fresh_ns = blank, period_ns, behind, fresh_ns
        self._sequence = 0
        self._rest: ScopeBlocks | None = None  # blocks of the stretches held back
        fields = {*(blank(0).dtype.names or ())}
        self._latest = {
            topics.APPLIED.name: _Latest(APPLIED, fields),
            topics.TRACE.name: _Latest(TRACE, fields),
        }

    def add(self, topic: str, messages: Records) -> None:
        """Add canonical messages of the topic `applied` or `trace`, in order; the last of each stretch is enough."""
        self._latest[topic].add(messages)

    def made(self, blocks: ScopeBlocks | None, last: bool) -> tuple[Records | None, Column]:
        """Messages of the stretches that end within these blocks, and their log times; None for none.

        A change of the number of samples drops the unfinished stretch. `last`: no block follows, so the last stretch ends too.
        """
        blocks = self._with_the_rest(blocks)
        if blocks is None:
            return None, np.empty(0, np.int64)
        starts = np.flatnonzero(np.diff((blocks.t_ns - 1) // self._period_ns, prepend=-1))
        ends = np.append(starts[1:], len(blocks.t_ns))
        self._rest = None
        if not last:
            late = slice(int(starts[-self._behind :][0]), None)
            self._rest = ScopeBlocks(
                blocks.t_ns[late].copy(), blocks.log_ns[late].copy(), blocks.samples[:, late].copy()
            )
            starts, ends = starts[: -self._behind], ends[: -self._behind]
        if not len(starts):
            return None, ends
        records = self._blank(len(starts))
        records["sequence"] = self._sequence + np.arange(len(starts), dtype=np.uint64)
        records["t_ns"] = blocks.t_ns[ends - 1]
        self._sequence += len(starts)
        samples = blocks.samples.shape[2]
        figures = envelope_of(blocks.samples.reshape(len(CHANNELS), -1)[:, : ends[-1] * samples], starts * samples)
        for row, channel in enumerate(CHANNELS):
            for field, values in zip(fields_of(channel), figures, strict=True):
                records[field] = values[row]
        for latest in self._latest.values():
            latest.fill(records, self._fresh_ns)
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
