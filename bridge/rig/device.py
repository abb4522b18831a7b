"""The contract of a device: a converter that samples the sensors, and an exciter. An adapter implements it, in one file.

Calls come from one thread, in this order: `open`, then `write` and `read` in turn, at last `safe` and `close`. The guard decides
in front of the device; the device's own watchdog ends the vibration when this process is gone.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, NamedTuple

from bridge.arrays import Floats, Records
from bridge.wire.messages import ANNOUNCE

LONGEST_READ_BLOCKS = 3  # a `read` returns after this many block lengths at the latest
LONGEST_READ_S = 5.0  # and of a device that makes a block for each `write`, which has no clock, after this time
Pace = Literal["device", "computer", "caller"]


class DeviceError(Exception):
    """The device refused an order or is gone; the text goes to the operator."""


class Setup(NamedTuple):
    """The facts of the rig file that an adapter receives."""

    settings: Mapping[str, Any]  # table [device]
    folder: Path  # of the rig file; relative paths in it begin there
    sample_rate_Hz: float
    samples_per_block: int
    channels: int  # number of channels that the rig file uses
    has_enable_line: bool  # whether `enable` switches the amplifier


class DeviceBlock(NamedTuple):
    """One block, in units of the device."""

    samples: Floats  # as measured, float64 [channels of the device, samples]; NaN: missing, never filled
    frequency_Hz: float  # of the exciter at the block's end, as the device executed it
    amplitude: float  # the same, in the unit of `write`
    lost: int = 0  # whole blocks that were lost before this one
    waiting: int = 0  # complete blocks that wait behind it
    dropped: str = ""  # data before this block that could not be read, for the operator


class Device(ABC):
    """A converter and an exciter."""

    # whose clock makes a block: the device's, if `read` waits until a block is complete; the computer's, whose loop reads one
    # each block length; or none, as a simulated device makes a block for each `write`
    pace: Pace = "device"

    def __init__(self, setup: Setup) -> None:
        """Read the settings, without a connection. Raises Fault CONFIG."""
        self.setup = setup
        self.block_s = setup.samples_per_block / setup.sample_rate_Hz  # by the device's clock, as its maker states it

    @property
    def longest_read_s(self) -> float:
        """Time after which a `read` without a block returns."""
        return LONGEST_READ_S if self.pace == "caller" else LONGEST_READ_BLOCKS * self.block_s

    @property
    def answer_s(self) -> float:
        """Time from an order to its acknowledgement, of the newest acknowledged one; 0 if `write` waits for it."""
        return 0.0

    @abstractmethod
    def open(self) -> None:
        """Connect, with the exciter at rest. Raises DeviceError."""

    @abstractmethod
    def read(self) -> DeviceBlock | None:
        """The next block; None if none is complete within `longest_read_s`. Raises DeviceError."""

    @abstractmethod
    def write(self, frequency_Hz: float, amplitude: float) -> None:
        """Set the vibration: displacement amplitude [m], or [V] for a rig file with `stroke_m_per_V`; 0: rest.

        After a refusal the exciter must be at rest; the next amplitude begins near 0. Raises DeviceError if the device refuses.
        """

    @abstractmethod
    def safe(self) -> None:
        """Bring the exciter to rest now, without a ramp if need be; raises nothing."""

    @abstractmethod
    def close(self) -> None:
        """Disconnect; raises nothing."""

    def enable(self, on: bool, toggle: int) -> None:
        """Set the enable line of the amplifier, and the output that a watchdog observes. Raises DeviceError."""
        raise DeviceError(f"enable {on}, {toggle}: this device has no enable line")

    def announcements(self) -> Records:
        """Coming velocities of the drive, records of `Announce` before the next samples; by default none."""
        return ANNOUNCE.blank(0)
