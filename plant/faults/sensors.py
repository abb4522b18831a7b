"""Faults of sensors: they replace the samples of a channel for every reader, including the rig's guard."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from bridge.arrays import Floats
from bridge.wire.messages import CHANNELS
from plant.faults.kinds import ALL_SENSORS, LARGEST
from plant.faults.table import FaultTable

_JUMP_S = 0.1
_HUM_HZ = 50.0
_LOOSE_BLOCKS = 5.0  # mean length of a burst


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
            since_s: from the fault's begin to the begin of the block.

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

    def off(self, samples: Floats, _s: float) -> Floats:
        return np.full_like(samples, self.size)

    def stuck(self, samples: Floats, _s: float) -> Floats:
        return np.full_like(samples, self.before[-1])

    def frozen(self, samples: Floats, _s: float) -> Floats:
        return np.resize(self.before, samples.shape)

    def garbage(self, samples: Floats, _s: float) -> Floats:
        return self.random.uniform(-self.size, self.size, samples.shape)

    def scaled(self, samples: Floats, _s: float) -> Floats:
        return samples * self.size

    def offset(self, samples: Floats, _s: float) -> Floats:
        return samples + self.size

    def delayed(self, samples: Floats, _s: float) -> Floats:
        """By whole samples; until the first has arrived, the channel holds its last value."""
        count = round(self.size / self.sample_s)
        self.line = [np.concatenate([*self.line, samples])]
        missing = max(len(samples) + count - len(self.line[0]), 0)
        held = np.full(min(missing, len(samples)), self.before[-1])
        shown = np.concatenate([held, self.line[0][: len(samples) - len(held)]])
        self.line = [self.line[0][len(samples) - len(held) :]]
        return shown

    def clipped(self, samples: Floats, _s: float) -> Floats:
        return np.clip(samples, -self.size, self.size)

    def nan(self, samples: Floats, _s: float) -> Floats:
        return np.full_like(samples, math.nan) if self.random.random() < self.size else samples

    def huge(self, samples: Floats, _s: float) -> Floats:
        samples[len(samples) // 2] = self.size
        return samples

    def drifting(self, samples: Floats, since_s: float) -> Floats:
        return samples + self.size * (since_s + self.sample_s * np.arange(len(samples)))

    def fading(self, samples: Floats, since_s: float) -> Floats:
        return samples * max(1.0 + self.size * since_s, 0.0)

    def jumping(self, samples: Floats, since_s: float) -> Floats:
        return samples if int(since_s / _JUMP_S) % 2 else samples + self.size

    def noise(self, samples: Floats, _s: float) -> Floats:
        return samples + self.size * self.random.standard_normal(samples.shape)

    def loose(self, samples: Floats, _s: float) -> Floats:
        """Alternating between two states, so that it is off for `size` of the time."""
        share = min(max(self.size, 1e-6), 1.0 - 1e-6)
        odds = (1.0 - share) if self.is_off else share
        if self.random.random() < odds / (_LOOSE_BLOCKS * max(share, 1.0 - share)):
            self.is_off = not self.is_off
        return np.zeros_like(samples) if self.is_off else samples

    def coarse(self, samples: Floats, _s: float) -> Floats:
        return np.round(samples / self.size) * self.size if self.size > 0.0 else samples

    def flipped(self, samples: Floats, _s: float) -> Floats:
        """As on the wire: in a 4-byte number."""
        if self.random.random() < self.size:
            carried = samples.astype(np.float32)
            carried.view(np.uint32)[self.random.integers(len(samples))] ^= np.uint32(1 << int(self.random.integers(32)))
            return carried.astype(np.float64)
        return samples

    def hum(self, samples: Floats, since_s: float) -> Floats:
        t_s = since_s + self.sample_s * np.arange(len(samples))
        return samples + self.size * np.sin(2.0 * math.pi * _HUM_HZ * t_s)


_KINDS: dict[str, Callable[[_Channel, Floats, float], Floats]] = {
    made.__name__: made
    for made in (
        *(_Channel.off, _Channel.stuck, _Channel.frozen, _Channel.garbage, _Channel.scaled, _Channel.offset),
        *(_Channel.delayed, _Channel.clipped, _Channel.nan, _Channel.huge, _Channel.drifting, _Channel.fading),
        *(_Channel.jumping, _Channel.noise, _Channel.loose, _Channel.coarse, _Channel.hum, _Channel.flipped),
    )
}
