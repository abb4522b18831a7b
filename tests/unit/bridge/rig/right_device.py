"""A right adapter around a simulated device in this process, in simulated time; a mistake changes one of its methods."""

import math
from pathlib import Path
from typing import Any

import numpy as np

from bridge.arrays import Floats
from bridge.rig.device import Device, DeviceBlock, DeviceError, Setup

RATE_HZ, SAMPLES = 20_000.0, 20
DRIVE_MPS, SLIP_M, SLIP_S, SPRING_N_PER_M = 5e-4, 4e-4, 0.01, 11_700.0
NOISE = (0.02, 0.05, 0.01, 1e-7, 1e-7)
SLEW_M_PER_S = 1e-6
WATCHDOG_S = 0.1


def motion(t_s: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Force, slide acceleration, slide and drive position of a slide that slips by 0.4 mm each 0.8 s."""
    period_s = SLIP_M / DRIVE_MPS
    slips, since_s = np.divmod(t_s, period_s)
    at = np.pi * np.minimum(since_s / SLIP_S, 1.0)
    slide_m = SLIP_M * (slips + (1.0 - np.cos(at)) / 2.0)
    accel = np.where(since_s < SLIP_S, SLIP_M / 2.0 * (np.pi / SLIP_S) ** 2 * np.cos(at), 0.0)
    drive_m = DRIVE_MPS * t_s + SLIP_M
    return SPRING_N_PER_M * (drive_m - slide_m), accel, slide_m, drive_m


class Simulated:
    """The device: it has a clock, a ramp, a watchdog and an enable line."""

    def __init__(self, rate: float, slew_m_per_s: float, facts: Setup, moves: bool) -> None:
        self.now_s = 0.0
        self.made = 0
        self.samples, self.rate_Hz = facts.samples_per_block, facts.sample_rate_Hz
        self.block_s = self.samples / self.rate_Hz / rate
        self._moves = moves
        self.frequency_Hz, self.ordered_m, self.amplitude_m = 2000.0, 0.0, 0.0
        self.is_on = True
        self.ordered_s = 0.0
        self._slew_m = slew_m_per_s * self.samples / self.rate_Hz
        self._phase = 0.0
        self._random = np.random.default_rng(1)
        self.ready: list[DeviceBlock] = []

    def monotonic(self) -> float:
        return self.now_s

    def sleep(self, for_s: float) -> None:
        self.now_s += for_s
        self._catch_up()

    def order(self, frequency_Hz: float, amplitude_m: float) -> None:
        self.frequency_Hz, self.ordered_m, self.ordered_s = frequency_Hz, amplitude_m, self.now_s

    def next(self) -> DeviceBlock:
        """The next block; time passes until it is complete."""
        if not self.ready:
            self.now_s = max(self.now_s, (self.made + 1) * self.block_s)
            self._catch_up()
        block = self.ready.pop(0)
        return block._replace(waiting=len(self.ready))

    def _catch_up(self) -> None:
        while (self.made + 1) * self.block_s <= self.now_s + 1e-9:
            self.ready.append(self._make())

    def _make(self) -> DeviceBlock:
        end_s = (self.made + 1) * self.block_s
        is_left = end_s - self.ordered_s > WATCHDOG_S
        wanted_m = self.ordered_m if self.is_on and not is_left else 0.0
        before_m = self.amplitude_m
        self.amplitude_m += min(max(wanted_m - before_m, -self._slew_m), self._slew_m)
        step = np.arange(1, self.samples + 1)
        t_s = (self.made * self.samples + step) / self.rate_Hz
        omega = 2.0 * math.pi * self.frequency_Hz
        real_step_s = self.block_s / self.samples
        phase = self._phase + omega * real_step_s * step
        self._phase = float(phase[-1])
        amplitude_m = before_m + (self.amplitude_m - before_m) * step / self.samples
        force, accel, slide_m, drive_m = motion(t_s if self._moves else np.full_like(t_s, 0.5))
        samples = np.array([force, accel, -amplitude_m * omega**2 * np.sin(phase), slide_m, drive_m])
        samples += np.array(NOISE)[:, None] * self._random.standard_normal(samples.shape)
        self.made += 1
        return DeviceBlock(samples, self.frequency_Hz, self.amplitude_m)


class Right(Device):
    """An adapter without a mistake."""

    rate = 1.0
    slew_m_per_s = SLEW_M_PER_S
    moves = True

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        self.device = Simulated(self.rate, self.slew_m_per_s, setup, self.moves)
        self.is_open = False

    def open(self) -> None:
        self.is_open = True

    def read(self) -> DeviceBlock | None:
        if not self.is_open:
            raise DeviceError("not open")
        return self.device.next()

    def write(self, frequency_Hz: float, amplitude: float) -> None:
        self.device.order(frequency_Hz, amplitude)

    def enable(self, on: bool, toggle: int) -> None:  # noqa: ARG002
        self.device.is_on = on

    def safe(self) -> None:
        self.device.order(self.device.frequency_Hz, 0.0)

    def close(self) -> None:
        self.safe()
        self.is_open = False


def setup(**more: Any) -> Setup:
    return Setup({}, Path(), RATE_HZ, SAMPLES, 5, has_enable_line=True)._replace(**more)
