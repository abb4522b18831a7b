"""The contract of a device: a converter that samples the sensors, and an exciter. An adapter implements it, in one file.

Calls come from one thread, in this order: `open`, then `write` and `read` in turn, at last `safe` and `close`. No method keeps
a rig alive: the guard decides in front of the device, and a device has its own watchdog behind it.
"""

from abc import ABC, abstractmethod
from typing import Literal, NamedTuple

from bridge.arrays import Floats, Records
from bridge.wire.messages import ANNOUNCE

LONGEST_READ_BLOCKS = 3  # a `read` returns after this many block lengths at the latest
Pace = Literal["device", "computer"]


class DeviceError(Exception):
    """The device refused an order or is gone; the text goes to the operator."""


class DeviceBlock(NamedTuple):
    """One block of samples."""

    samples: (
        Floats  # float64 [channels of the device, samples], as the device measures them; NaN: missing, never filled
    )
    frequency_Hz: float  # of the exciter at the block's end, as the device executed it
    amplitude_m: float
    lost: int = 0  # whole blocks that were lost before this one
    waiting: int = 0  # complete blocks that wait behind it


class Device(ABC):
    """A converter and an exciter. The facts below are valid after `open`."""

    block_s: float  # length of a block by the device's clock, as its maker states it
    samples_per_block: int
    # whose clock makes a block: the device's, if `read` waits until a block is complete; or the computer's, whose loop reads one
    # each block length
    pace: Pace = "device"
    watchdog_s: float = 0.0  # silence after which the device ends the vibration by itself; 0: it has no watchdog
    has_enable_line: bool = False  # whether `enable` switches the amplifier

    @abstractmethod
    def open(self) -> None:
        """Connect, with the exciter at rest. Raises DeviceError."""

    @abstractmethod
    def read(self) -> DeviceBlock | None:
        """The next block; None if none is complete within LONGEST_READ_BLOCKS block lengths. Raises DeviceError."""

    @abstractmethod
    def write(self, frequency_Hz: float, amplitude_m: float) -> None:
        """Set the vibration: amplitude of the base's displacement [m], 0 for rest. Raises DeviceError if the device refuses.

        After a refusal the exciter must be at rest; the next amplitude begins near 0.
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
