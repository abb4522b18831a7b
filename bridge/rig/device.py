"""The contract of a device: a converter that samples the sensors, and an exciter, or each alone. An adapter implements it, in one
file.

Calls come from one thread, in this order: `open`, then `write` and `read` in turn, at last `safe` and `close`. The guard decides
in front of the device; the device's own watchdog ends the vibration when this process is gone. Any exception counts as a
DeviceError: an adapter need not catch errors of sockets and drivers.
"""

import traceback
from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from bridge.arrays import Floats, Records
from bridge.wire.messages import ANNOUNCE

LONGEST_READ_BLOCKS = 3  # a `read` returns after this many block lengths at the latest
LONGEST_READ_S = 5.0  # and of a device that makes a block for each `write`, which has no clock, after this time
Pace = Literal["device", "computer", "caller"]
_NONE = ANNOUNCE.blank(0)


class DeviceError(Exception):
    """The device refused an order or is gone.

    Args:
        text: for the operator.
        code: of the event, if `open` or `read` raises it, such as DEVICE_BUSY for a device that another client holds.

    """

    def __init__(self, text: str, code: str = "DEVICE_GONE") -> None:
        super().__init__(text)
        self.code = code


def reason_of(error: Exception) -> str:
    """The reason of a failed call. An adapter may be foreign code: its error must not end the loop of the guard."""
    if isinstance(error, DeviceError | OSError):  # the system's words for a lost connection need no place in a file
        return str(error)
    place = traceback.extract_tb(error.__traceback__)[-1]
    return f"{Path(place.filename).name}, line {place.lineno}: {type(error).__name__}: {error}"


class Setup(NamedTuple):
    """The facts of the rig file that an adapter receives."""

    settings: Mapping[str, Any]  # table [device], or [exciter.device]
    folder: Path  # of the rig file; relative paths in it begin there
    sample_rate_Hz: float
    samples_per_block: int
    channels: int  # number of channels that the rig file uses
    has_enable_line: bool  # whether `enable` switches the amplifier
    in_volts: bool = False  # whether amplitudes are volts, as the rig file has `stroke_m_per_V`


def wrong_shape(samples: Any, setup: Setup) -> str:
    """The reason why the samples of a block cannot be used; empty: they can."""
    shape = np.shape(samples)  # an adapter may return anything
    if len(shape) == 2 and shape[0] >= setup.channels and shape[1] == setup.samples_per_block:
        return ""
    due = f"{setup.channels} channels or more x {setup.samples_per_block} samples"
    return f"samples of shape {shape}: must be {due}; compare the adapter with [channels] and [converter]"


class DeviceBlock(NamedTuple):
    """One block, in units of the device."""

    samples: Floats  # as measured, float64 [channels of the device, samples]; NaN: missing, never filled
    frequency_Hz: float  # of the exciter at the block's end, as the device executed it
    amplitude: float  # the same, in the unit of `write`
    lost: int = 0  # whole blocks that were lost before this one
    waiting: int = 0  # complete blocks that wait behind it


class Part(ABC):
    """A connection whose exciter can be set."""

    # silence after which the device ends the vibration by itself, where the adapter knows it; 0: unknown
    watchdog_s = 0.0
    slowest_answer_s = 0.0  # longest time from `write` until the device executes it, beyond the block under way

    def __init__(self, setup: Setup) -> None:
        """Read the settings, without a connection. Raises Fault CONFIG."""
        self.setup = setup
        self.block_s = setup.samples_per_block / setup.sample_rate_Hz  # by the device's clock, as its maker states it

    @property
    def answer_s(self) -> float:
        """Time from an order to its acknowledgement, of the newest acknowledged one; 0 if `write` waits for it."""
        return 0.0

    @abstractmethod
    def open(self) -> None:
        """Connect, with the exciter at rest. Raises DeviceError."""

    @abstractmethod
    def write(self, frequency_Hz: float, amplitude: float) -> None:
        """Set the vibration: displacement amplitude [m], or [V] for a rig file with `stroke_m_per_V`; 0: rest.

        After a refusal the exciter must be at rest; the next amplitude begins near 0. Raises DeviceError if the device refuses.
        """

    @abstractmethod
    def safe(self) -> None:
        """Bring the exciter to rest until the next `write`, without a ramp if need be; raises nothing."""

    @abstractmethod
    def close(self) -> None:
        """Disconnect; raises nothing."""

    def enable(self, on: bool, toggle: int) -> None:
        """Set the enable line of the amplifier, and the output that a watchdog observes. Raises DeviceError."""
        raise DeviceError(f"enable {on}, {toggle}: this device has no enable line")


class Device(Part):
    """A converter and an exciter."""

    settable: frozenset[str] = frozenset()  # quantities that `set` can change: "speed" and "load" of a model
    # whose clock makes a block: the device's, if `read` waits until a block is complete; the computer's, whose loop reads one
    # each block length; or none, as a simulated device makes a block for each `write`
    pace: Pace = "device"

    @property
    def longest_read_s(self) -> float:
        """Time after which a `read` without a block returns."""
        return LONGEST_READ_S if self.pace == "caller" else LONGEST_READ_BLOCKS * self.block_s

    @abstractmethod
    def read(self) -> DeviceBlock | None:
        """The next block; None if none is complete within `longest_read_s`. Raises DeviceError."""

    def problems(self) -> list[tuple[str, str]]:
        """New problems with the data since the last call: code of an event, such as BLOCK_SHORT, and text; by default none."""
        return []

    def announcements(self) -> Records:
        """Coming velocities of the drive, records of `Announce` before the next samples; by default none."""
        return _NONE

    @property
    def speed_mps(self) -> float:
        """Velocity of the drive [m/s], where `set` can change it."""
        return 0.0

    def set(self, name: str, value: float) -> None:
        """Set one of `settable` for the coming blocks: the drive's speed [m/s], or the load in multiples of its start value."""
        raise DeviceError(f"{name} = {value:g}: is set by the machine")


class Exciter(Part):
    """An exciter whose sensors another device samples; `write` is called for each block and never waits."""

    @property
    @abstractmethod
    def executed(self) -> tuple[float, float]:
        """Frequency [Hz] and amplitude that the exciter last acknowledged. Raises DeviceError once it is gone."""


class Pair(Device):
    """A sampler and an exciter as one device; the sampler's clock is the time.

    Args:
        sampler: its exciter, if it has one, stays at rest.
        exciter: of the rig.

    """

    def __init__(self, sampler: Device, exciter: Exciter) -> None:
        super().__init__(sampler.setup)
        self._sampler, self._exciter = sampler, exciter
        self.pace, self.watchdog_s = sampler.pace, exciter.watchdog_s
        self.slowest_answer_s = exciter.slowest_answer_s

    @property
    def answer_s(self) -> float:
        """Answer time of the exciter."""
        return self._exciter.answer_s

    def open(self) -> None:
        """Connect to both."""
        self._exciter.open()
        try:
            self._sampler.open()
        except BaseException:
            self._exciter.close()
            raise

    def read(self) -> DeviceBlock | None:
        """The sampler's next block, with the vibration that the exciter acknowledged."""
        block = self._sampler.read()
        frequency_Hz, amplitude = self._exciter.executed
        return block and block._replace(frequency_Hz=frequency_Hz, amplitude=amplitude)

    def write(self, frequency_Hz: float, amplitude: float) -> None:
        """Set the exciter; a sampler that waits for the caller makes its next block."""
        try:
            self._exciter.write(frequency_Hz, amplitude)
        finally:
            if self.pace == "caller":
                self._sampler.write(frequency_Hz, 0.0)

    def enable(self, on: bool, toggle: int) -> None:
        """Set the exciter's enable line."""
        self._exciter.enable(on, toggle)

    def problems(self) -> list[tuple[str, str]]:
        """New problems with the sampler's data."""
        return self._sampler.problems()

    def announcements(self) -> Records:
        """Coming velocities of the drive, as the sampler knows them."""
        return self._sampler.announcements()

    def safe(self) -> None:
        """Bring the exciter to rest."""
        self._exciter.safe()

    def close(self) -> None:
        """Disconnect from both."""
        self._sampler.close()
        self._exciter.close()
