"""Pending rows of a run, and the windows in which they are judged.

A log is judged window by window: up to 60 s of blocks, with 2 s before them and at least 10 s after them. So each block is judged
once, by the same rules, and a run of an hour needs the memory of one window. A window ends at a turn of the drive, if there is a
turn: each stroke is then judged as a whole.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.arrays import Records

Rows = npt.NDArray[Any]

# Blocks per window. More: the thresholds for slips follow a change of the force less well, and memory grows (0.3 kB per block).
# Fewer: strokes are cut. With 5000 the shipped scenarios give the same slips; the swing of the pneumatic seal, which has longer
# strokes, is 2.9 instead of 1.1 N.
WINDOW_BLOCKS = 60_000
# A window is judged once the log is read this far beyond its end. Less than 8 s: the swing of a phase may change with the length
# of the rest of the run. More: memory grows.
AHEAD_S = 10.0
# Rows before a window kept for context. Less: a slip (0.1 s) or a ramp of the vibration (0.15 s) that began earlier is cut.
BEHIND_S = 2.0

TRACE_ROW = np.dtype(
    [
        ("t_ns", "i8"), ("block", "i8"), ("mode", "u1"), ("limit", "u1"), ("state", "u1"),
        ("drive_velocity_mps", "f8"), ("vibration_velocity_mps", "f8"), ("lateness_ns", "i8"), ("events", "u4"),
        ("velocity_ratio", "f8"), ("drive_force_N", "f8"), ("slips", "i8"), ("surges", "i8"),
    ]
)  # fmt: skip
APPLIED_ROW = np.dtype(
    [
        ("t_ns", "i8"), ("sequence", "i8"), ("amplitude_m", "f8"), ("command_block", "u8"), ("late_ns", "i8"),
        ("commands_late", "i8"), ("fallback", "u1"), ("frequency_Hz", "f8"), ("guard_state", "u1"),
    ]
)  # fmt: skip

LAYOUTS = {"trace": TRACE_ROW, "applied": APPLIED_ROW}


class JudgedBlocks(NamedTuple):
    """Sensor blocks, reduced for the judge."""

    sequence: Rows  # int64, [blocks]
    t_ns: Rows  # int64, [blocks]
    force_N: Rows  # float32, [blocks, samples]
    drive_m: Rows  # drive position: float64, means of bins, [blocks, bins]
    slide_m: Rows  # slide position, likewise
    base_mps2: Rows  # base accelerometer: float64, rms about the mean of each block, [blocks]
    slide_mps2: Rows  # slide's accelerometer, likewise

    def part(self, rows: Any) -> "JudgedBlocks":
        """A selection of the blocks."""
        return JudgedBlocks(*(column[rows] for column in self))


def reduced(sensors: Records, bins: int) -> JudgedBlocks:
    """Reduce sensor messages, [blocks]; `bins` divides the number of samples."""
    return JudgedBlocks(
        sensors["sequence"].astype(np.int64),
        sensors["t_ns"].astype(np.int64),
        np.ascontiguousarray(sensors["drive_force_N"]),
        means(sensors["drive_position_m"], bins),
        means(sensors["mass_position_m"], bins),
        _rms(sensors["base_accel_mps2"]),
        _rms(sensors["mass_accel_mps2"]),
    )


def means(samples: npt.NDArray[Any], bins: int) -> npt.NDArray[np.float64]:
    """Means of the bins of blocks, [blocks, bins]."""
    count = samples.shape[1] // bins
    exact = np.ascontiguousarray(samples).astype(np.float64)
    return np.add.reduce(exact.reshape(len(samples), bins, count), axis=2) / count


def _rms(samples: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    """Root mean square about the mean of each block, [blocks]."""
    mean = np.einsum("ij->i", samples) / samples.shape[1]
    with np.errstate(invalid="ignore"):  # samples that are not finite
        square = np.einsum("ij,ij->i", samples, samples) / samples.shape[1] - mean * mean
    return np.sqrt(np.maximum(square, 0.0)).astype(np.float64)


def rows_of(records: Records, layout: np.dtype[Any]) -> Rows:
    """The fields of `layout` of messages, [messages]."""
    rows = np.empty(len(records), layout)
    for name in layout.names or ():
        rows[name] = records[name]
    return rows


class Window(NamedTuple):
    """Rows of one window: those from `first` up to, not including, `end` are judged; the others are their context."""

    blocks: JudgedBlocks
    trace: Rows
    applied: Rows
    first: int
    end: int
    begins: int  # first row, among those kept, of the stroke that contains `first`
    after_turn: bool  # that stroke starts at `begins`, with a turn of the drive; False: it started earlier
    stroke: int  # number of that stroke, counted over the run
    is_last: bool

    @property
    def own_ns(self) -> tuple[int, int]:
        """Times of the first judged row and of the first row after the judged rows; unlimited at the begin and end of the log."""
        t_ns = self.blocks.t_ns
        far = np.iinfo(np.int64)
        from_ns = int(t_ns[self.first]) if self.first else far.min
        return from_ns, far.max if self.is_last else int(t_ns[self.end])

    def own(self, rows: Rows) -> npt.NDArray[np.bool_]:
        """Select the judged rows by their times."""
        from_ns, until_ns = self.own_ns
        return np.asarray((rows["t_ns"] >= from_ns) & (rows["t_ns"] < until_ns))


class WaitingRows:
    """Rows pending for their window."""

    def __init__(self) -> None:
        self.blocks = 0
        self._sensors: list[JudgedBlocks] = []
        self._rows: dict[str, list[Rows]] = {name: [np.empty(0, layout)] for name, layout in LAYOUTS.items()}
        self._first = self._begins = self._stroke = 0
        self._after_turn = False

    def sensors(self, blocks: JudgedBlocks) -> None:
        """Add blocks."""
        self._sensors.append(blocks)
        self.blocks += len(blocks.sequence)

    def others(self, topic: str, records: Records) -> None:
        """Add messages of a topic in `LAYOUTS`."""
        self._rows[topic].append(rows_of(records, LAYOUTS[topic]))

    def is_full(self, block_s: float) -> bool:
        """True if the rows of a window and of the time after it are pending, so it can be judged."""
        return self.blocks - self._first > WINDOW_BLOCKS + AHEAD_S / block_s

    def window(self, is_last: bool, block_s: float) -> Window:
        """All pending rows, of which at least one is a block; `end` is the latest possible end of the window."""
        return Window(
            JudgedBlocks(*(np.concatenate(columns) for columns in zip(*self._sensors, strict=True))),
            *(np.concatenate(parts) for parts in self._rows.values()),
            first=self._first,
            end=self.blocks if is_last else self.blocks - round(AHEAD_S / block_s),
            begins=self._begins,
            after_turn=self._after_turn,
            stroke=self._stroke,
            is_last=is_last,
        )

    def judged(self, window: Window, turned: bool, stroke: int, block_s: float) -> None:
        """Drop the rows that the next window does not need. It begins in stroke number `stroke`, at a turn if `turned`."""
        keep = max(window.end - round(BEHIND_S / block_s), 0)
        self._sensors = [JudgedBlocks(*(column[keep:].copy() for column in window.blocks))]
        keep_ns = int(window.blocks.t_ns[keep])
        for name, rows in (("trace", window.trace), ("applied", window.applied)):
            self._rows[name] = [rows[rows["t_ns"] >= keep_ns]]
        self.blocks -= keep
        self._first = window.end - keep
        self._begins = self._first if turned else 0
        self._after_turn, self._stroke = turned, stroke


class HasMoved:
    """Whether a position channel has moved so far: a missing channel is constant."""

    def __init__(self) -> None:
        self._ends: dict[str, tuple[float, float]] = {}

    def __call__(self, name: str, place_m: npt.NDArray[np.floating[Any]]) -> bool:
        """Add the positions of a window, [bins]; True if the channel has moved so far."""
        known_m = place_m[np.isfinite(place_m)]
        low_m, high_m = self._ends.get(name, (math.inf, -math.inf))
        if len(known_m):
            low_m, high_m = min(low_m, float(known_m.min())), max(high_m, float(known_m.max()))
        self._ends[name] = low_m, high_m
        return high_m > low_m
