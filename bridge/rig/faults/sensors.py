"""Faults of sensors: they replace the samples of a channel for every reader, including the rig's guard."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from bridge.arrays import Floats
from bridge.rig.faults.kinds import ALL_SENSORS, LARGEST
from bridge.rig.faults.table import FaultTable
from bridge.wire.channels import CHANNELS

_JUMP_S = 0.1  # time with, then without the offset of the fault `jumping`
_HUM_HZ = 50.0  # mains frequency, of the fault `hum`
_SLIP_S = 0.01  # time between two steps of the fault `slipping`
_BURST_S, _BURST_EVERY_S = 0.003, 0.037  # duration and period of the bursts of the fault `bursts`
_LOOSE_BLOCKS = 5.0  # mean length of a burst of the fault `loose` [blocks]


class SensorFault:
    """One fault of one channel, or of all channels.

    Args:
        table: the fault.
        random: its random numbers.
        sample_s: time between two samples.

    """

    def __init__(self, table: FaultTable, random: np.random.Generator, sample_s: float) -> None:
        self._spoil = _KINDS.get(table.kind)
        self._other = table.other
        self._channels = CHANNELS if table.target == ALL_SENSORS else (table.target,)
        self._makers = {name: _Channel(table.size, random, sample_s) for name in self._channels}

    def look(self, block: Any) -> None:
        """Store a healthy block, the last before the fault."""
        for name in self._channels:
            self._makers[name].before = block[name].astype(np.float64)

    def spoil(self, block: Any, since_s: float) -> None:
        """Change the samples of a block, in place.

        Args:
            block: record of a sensor block.
            since_s: time from the fault's begin to the begin of the block.

        """
        if self._spoil is None:
            samples = block[self._channels[0]].copy()
            block[self._channels[0]][:] = block[self._other]
            block[self._other][:] = samples
            return
        for name in self._channels:
            samples = self._spoil(self._makers[name], block[name].astype(np.float64), since_s)
            block[name][:] = np.clip(samples, -LARGEST, LARGEST)


class _Channel:
    """The state of a fault on one channel."""

    def __init__(self, size: float, random: np.random.Generator, sample_s: float) -> None:
        self.size, self.random, self.sample_s = size, random, sample_s
        self.before: Floats = np.zeros(1)
        self.line: list[Floats] = []
        self.is_off = False
        self.charge = 0.0  # level that the fault `charge` has removed

    def delayed(self, samples: Floats, _s: float) -> Floats:
        """Samples delayed by whole samples; the channel holds its last healthy value until the first one arrives."""
        count = round(self.size / self.sample_s)
        self.line = [np.concatenate([*self.line, samples])]
        missing = max(len(samples) + count - len(self.line[0]), 0)
        held = np.full(min(missing, len(samples)), self.before[-1])
        shown = np.concatenate([held, self.line[0][: len(samples) - len(held)]])
        self.line = [self.line[0][len(samples) - len(held) :]]
        return shown

    def loose(self, samples: Floats, _s: float) -> Floats:
        """Samples, or zeros while the contact is open: for a share `size` of the time, in random bursts."""
        share = min(max(self.size, 1e-6), 1.0 - 1e-6)
        odds = (1.0 - share) if self.is_off else share
        if self.random.random() < odds / (_LOOSE_BLOCKS * max(share, 1.0 - share)):
            self.is_off = not self.is_off
        return np.zeros_like(samples) if self.is_off else samples

    def flipped(self, samples: Floats, _s: float) -> Floats:
        """In a share `size` of the blocks, a random bit of a random sample inverted, as a 4-byte number on the wire."""
        if self.random.random() < self.size:
            carried = samples.astype(np.float32)
            carried.view(np.uint32)[self.random.integers(len(samples))] ^= np.uint32(1 << int(self.random.integers(32)))
            return carried.astype(np.float64)
        return samples

    def huge(self, samples: Floats, _s: float) -> Floats:
        """Samples whose middle one is replaced by the fault's value."""
        samples[len(samples) // 2] = self.size
        return samples

    def charged(self, samples: Floats, _s: float) -> Floats:
        """Samples minus their slow mean, which a charge amplifier loses; at the begin nothing is lost."""
        share, shown, level = self.sample_s / self.size, np.empty_like(samples), self.charge
        for i, sample in enumerate(samples):
            shown[i] = sample - level
            level += share * shown[i]
        self.charge = level
        return shown

    def bursts(self, samples: Floats, since_s: float) -> Floats:
        """Samples with random numbers within the value added in the bursts."""
        added = self.random.uniform(-self.size, self.size, samples.shape)
        return samples + np.where(self.times_s(samples, since_s) % _BURST_EVERY_S < _BURST_S, added, 0.0)

    def times_s(self, samples: Floats, since_s: float) -> Floats:
        """Times of the samples since the begin of the fault [s]."""
        return since_s + self.sample_s * np.arange(len(samples))


# the faulty samples from the fault's state, the true samples and the time since the begin of the fault [s]
_KINDS: dict[str, Callable[[_Channel, Floats, float], Floats]] = {
    "off": lambda of, true, _: np.full_like(true, of.size),
    "stuck": lambda of, true, _: np.full_like(true, of.before[-1]),
    "frozen": lambda of, true, _: np.resize(of.before, true.shape),
    "garbage": lambda of, true, _: of.random.uniform(-of.size, of.size, true.shape),
    "scaled": lambda of, true, _: true * of.size,
    "offset": lambda of, true, _: true + of.size,
    "delayed": _Channel.delayed,
    "clipped": lambda of, true, _: np.clip(true, -of.size, of.size),
    "nan": lambda of, true, _: np.full_like(true, math.nan) if of.random.random() < of.size else true,
    "huge": _Channel.huge,
    "drifting": lambda of, true, since_s: true + of.size * of.times_s(true, since_s),
    "fading": lambda of, true, since_s: true * max(1.0 + of.size * since_s, 0.0),
    "jumping": lambda of, true, since_s: true if int(since_s / _JUMP_S) % 2 else true + of.size,
    "noise": lambda of, true, _: true + of.size * of.random.standard_normal(true.shape),
    "loose": _Channel.loose,
    "coarse": lambda of, true, _: np.round(true / of.size) * of.size if of.size > 0.0 else true,
    "hum": lambda of, true, since_s: true + of.size * np.sin(2.0 * math.pi * _HUM_HZ * of.times_s(true, since_s)),
    "flipped": _Channel.flipped,
    "slipping": lambda of, true, since_s: true + of.size * np.ceil(of.times_s(true, since_s) / _SLIP_S),
    "bursts": _Channel.bursts,
    "charge": _Channel.charged,
}
