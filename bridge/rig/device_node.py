"""A device behind its guard: its blocks, its silences and losses, and the vibration that it executes."""

import contextlib
import math
from collections.abc import Callable

import numpy as np

from bridge.arrays import Floats, Records
from bridge.guard.core import NO_COMMAND
from bridge.guard.states import LEAVE, apply_order
from bridge.rig.device import Device, DeviceBlock, DeviceError, reason_of, wrong_shape
from bridge.rig.faults.exciter import SpoiledExciter
from bridge.rig.faults.schedule import Faults
from bridge.rig.node import LATE_NS, GuardedNode
from bridge.rig.rate import RateWatch
from bridge.rig.step import begin, clipped, device_memory, end, fill
from bridge.rig.watch import DeviceWatch, Problem
from bridge.wire.clock import time
from bridge.wire.messages import ANNOUNCE as ANNOUNCE_LAYOUT
from bridge.wire.messages import APPLIED as APPLIED_LAYOUT
from bridge.wire.messages import COMMAND as COMMAND_LAYOUT
from bridge.wire.messages import sensor_block
from bridge.wire.topics import ANNOUNCE, Outgoing

# Time of the blocks that may wait without a report. Smaller: each short stall of the computer is reported. Larger: v_a swings by
# more than 4 % (the margin of the controller's LATE) without a report.
_BEHIND_S = 0.015
_CLIPPED_S = 0.2  # interval at which clipped channels are reported
# Interval of the attempts to open a lost device. Smaller: more load on a device that starts. Larger: a device that another client
# took is reported after more than 1 s.
_OPEN_AGAIN_S = 0.5


class DeviceNode(GuardedNode):
    """A device behind its guard. While the device is silent or gone, its exciter is kept at rest.

    Args:
        device: open, with its exciter at rest.
        guard: parameters and memory of its guard.
        faults: injected faults.
        memory: calibration of its channels, a record of `bridge.rig.step.DEVICE`; None: SI units in the order of CHANNELS.
        stroke_m: stroke of the exciter for one unit of its amplitude.
        derive: adds rows of derived channels to the samples of a block; None: none.
        exciter: the faults of its exciter; None: a real exciter, which has none.

    """

    kernels = "a device's rig"

    def __init__(
        self,
        device: Device,
        guard: tuple[Records, Records],
        faults: Faults,
        memory: Records | None = None,
        stroke_m: float = 1.0,
        derive: Callable[[Floats], Floats] | None = None,
        exciter: SpoiledExciter | None = None,
    ) -> None:
        super().__init__(guard, round(device.block_s * 1e9), device.setup.samples_per_block, faults)
        self._device, self._stroke_m, self._derive, self._exciter = device, stroke_m, derive, exciter
        self._memory = device_memory() if memory is None else memory
        self._block = DeviceBlock(np.zeros((1, 1)), 0.0, 0.0)
        self._is_begun = False  # whether the vibration of the block under way is set
        self._accepted = 0  # number of commands accepted for it
        # of the newest of them: block complete to acknowledged; the exciter's part of it
        self._took_s = self._answer_s = 0.0
        self._heard_s = time.monotonic()  # of the newest block
        self._timeout_s = int(guard[0][0].timeout_blocks) * device.block_s
        self._silent_since_s: float | None = None  # None while blocks arrive
        self._is_open = True
        self._open_again_s = 0.0
        self._silent_code = ""  # of the newest report of the silence
        self._problems: list[Problem] = []
        self._look_blocks = max(round(_CLIPPED_S / device.block_s), 1)
        self._begin_watches()

    def _begin_watches(self) -> None:
        device = self._device
        self._clock = RateWatch(device.setup.sample_rate_Hz, self._samples)
        self._watch = DeviceWatch(device.block_s, device.longest_read_s, self.paced_by_rig)

    @property
    def paced_by_rig(self) -> bool:
        """Whether `advance` waits until the device has a block."""
        return self._device.pace == "device"

    @property
    def is_behind(self) -> bool:
        """Whether more blocks of the device wait to be read."""
        return self._block.waiting > 0

    def idle(self) -> None:
        """Discard the blocks of a device that makes them by its own clock; the loop of the run reports a lost device."""
        with contextlib.suppress(Exception):
            while self.paced_by_rig and (block := self._device.read()) is not None and block.waiting:
                pass
        self._take_problems()
        self._heard_s = time.monotonic()

    def _step_copies(self) -> None:
        state, memory, sensors = self._guard_state.copy(), self._memory.copy(), sensor_block(self._samples).blank()
        apply_order(state[0], LEAVE)
        begin(self._guard_params, state, memory, COMMAND_LAYOUT.blank(0), ANNOUNCE_LAYOUT.blank(0))
        rows = np.zeros((int(memory["source"].max()) + 1, self._samples))
        fill(state, memory, self.block_ns, 0, rows, sensors)
        end(self._guard_params, state, memory, 0.0, 0.0, 0, 0, 0, 0, sensors, APPLIED_LAYOUT.blank())

    def _act(self, commands: Records) -> int | None:
        if self._silent_since_s is None and not self._is_begun:
            self._begin(commands)
        block = self._read()
        if block is None:
            return None
        self._note_block(block)
        if self._exciter is not None and (executed_m := self._exciter.executed_m) is not None:
            block = block._replace(amplitude=executed_m / self._stroke_m)
        self._block, self._is_begun = block, False
        samples = self._derive(block.samples) if self._derive is not None else block.samples
        fill(self._guard_state, self._memory, self.block_ns, block.lost, samples, self._sensors)
        if self.block % self._look_blocks == 0 and (names := clipped(self._memory, self._look_blocks * self._samples)):
            self._problems.append(("DEVICE_CLIPPED", f"{', '.join(names)}: many samples at one end of the range", 1))
        return self._accepted

    def _begin(self, commands: Records) -> None:
        """Set the vibration of the next block; later commands are dropped until it is there, as they answer older blocks."""
        announce = self._device.announcements()
        self.announcements = [Outgoing(ANNOUNCE, announce[row : row + 1].tobytes()) for row in range(len(announce))]
        self._accepted = begin(self._guard_params, self._guard_state, self._memory, commands, announce)
        ordered_s = time.monotonic()
        self._write()
        self._answer_s = time.monotonic() - ordered_s + self._device.answer_s
        if self._accepted:
            blocks = self.block - int(self._memory["command_block"][0]) + self._block.waiting - 1  # completed since
            self._took_s = ordered_s - self._heard_s + blocks * self._device.block_s + self._answer_s
        self._is_begun = True

    def _write(self) -> None:
        """Order the vibration that the guard allows; after a refusal it begins again from rest."""
        # a field of an array: an attribute of its record takes 2.5 us longer
        device, g, exciter = self._device, self._guard_state, self._exciter
        is_on = bool(g["enable"][0]) or (exciter is not None and exciter.is_always_on)
        try:
            if has_line := device.setup.has_enable_line:
                device.enable(is_on, int(g["toggle"][0]))
            frequency_Hz = float(g["frequency_Hz"][0])
            amplitude_m = float(g["amplitude_m"][0]) if is_on or has_line else 0.0
            amplitude_m = exciter.delivered_m(frequency_Hz, amplitude_m) if exciter is not None else amplitude_m
            amplitude = amplitude_m / self._stroke_m
            device.write(frequency_Hz, amplitude)
            if is_on or not has_line:  # while the line is off, the loop check watches the amplifier
                self._watch.order(amplitude)
        except Exception as error:
            self._rest()
            self._problems.append(
                ("DEVICE_REFUSED", f"{reason_of(error)}: the exciter rests, and begins again from 0", 1)
            )

    def _whole(self, block: DeviceBlock | None) -> DeviceBlock | None:
        """A block for the kernels; None for a block of another shape, or with a vibration that is not finite."""
        if block is None:
            return None
        if wrong := wrong_shape(block.samples, self._device.setup):
            self._problems.append(("DEVICE_DATA", f"{wrong}: dropped", 1))
            return None
        numbers = block.frequency_Hz, block.amplitude
        if not all(map(math.isfinite, numbers)):
            self._problems.append(("DEVICE_DATA", f"a vibration of {numbers}: dropped", 1))
            return None
        return block._replace(samples=np.ascontiguousarray(block.samples, np.float64))

    def _note_block(self, block: DeviceBlock) -> None:
        if block.lost:
            self._problems.append(("SAMPLES_LOST", "blocks were lost before they were read", block.lost))
        if block.waiting * self._device.block_s > _BEHIND_S:
            self._problems.append(("BEHIND", f"{block.waiting} blocks waited to be read", 1))
        now_s = time.monotonic()
        if self.paced_by_rig and (measured := self._clock.add(1 + block.lost, now_s)):
            self._problems.append((*measured, 1))
        self._problems += self._watch.look(block, now_s)

    def _take_problems(self) -> None:
        problems = self._device.problems()
        self._problems += [(*problem, 1) for problem in problems]
        if any(code == "DEVICE_RESTARTED" for code, _ in problems):
            self._rest()  # it has forgotten the vibration, which begins again from 0

    def _rest(self) -> None:
        self._guard_state["amplitude_m"] = 0.0
        self._watch.order(0.0)
        try:
            self._device.safe()
        except Exception as error:
            self._problems.append(("DEVICE_REFUSED", f"{reason_of(error)}: the exciter may still vibrate", 1))

    def _read(self) -> DeviceBlock | None:
        try:
            if self._watch.failure is not None:
                raise self._watch.failure
            if not self._is_open:
                self._open_again()
            block = self._whole(self._device.read()) if self._is_open else None
            self._take_problems()
        except Exception as error:
            self._fall_silent(error.code if isinstance(error, DeviceError) else "DEVICE_GONE", reason_of(error))
            with contextlib.suppress(Exception):  # it is lost already
                self._device.close()
            self._is_open, self._open_again_s = False, time.monotonic() + _OPEN_AGAIN_S
            self._begin_watches()
            return None
        now_s = time.monotonic()
        if block is None:
            self._watch.empty()
            if now_s - self._heard_s > self._timeout_s:
                self._fall_silent("DEVICE_SILENT", f"no block for {self._timeout_s:g} s")
            return None
        self._heard_s = now_s
        if self._silent_since_s is not None:
            silent_s = now_s - self._silent_since_s
            self._problems.append(("DEVICE_BACK", f"blocks again after {silent_s:.2f} s", 1))
            self._silent_since_s, self._silent_code = None, ""
            self._begin_watches()
            if not block.lost:  # the device does not know: without the lost time a moving drive would jump
                block = block._replace(lost=max(round(silent_s / self._device.block_s) - 1, 0))
        return block

    def _fall_silent(self, code: str, why: str) -> None:
        """Let the exciter rest until blocks arrive again."""
        if self._silent_since_s is None:
            self._silent_since_s, self._is_begun, self._accepted = self._heard_s, False, 0
            self._rest()
        elif code in (self._silent_code, "DEVICE_SILENT"):
            return
        self._silent_code = code
        self._problems.append((code, f"{why}: the exciter rests", 1))

    def _open_again(self) -> None:
        """Try to open a lost device, twice a second. Raises DeviceError."""
        if time.monotonic() < self._open_again_s:
            if self.paced_by_rig:
                time.sleep(self.block_ns * 1e-9)
            return
        self._device.open()
        self._device.safe()
        self._is_open = True

    def _report(self, accepted: int, commands_late: int, round_trip_ns: int, late_ns: int) -> None:
        block = self._block
        if self.paced_by_rig:
            late_ns = block.waiting * self.block_ns
            round_trip_ns = round(self._took_s * 1e9) if accepted else 0
            commands_late = accepted if round_trip_ns > LATE_NS else 0
            self._applied["answer_ns"] = round(self._answer_s * 1e9)
            self._applied["sample_rate_Hz"] = self._clock.rate_Hz
        end(
            self._guard_params, self._guard_state, self._memory, block.frequency_Hz, block.amplitude * self._stroke_m,
            accepted, commands_late, round_trip_ns, late_ns, self._sensors, self._applied,
        )  # fmt: skip

    def set(self, name: str, value: float) -> None:
        """Set the speed or the load of a model from the next block on."""
        self._device.set(name, value)

    def let_go(self) -> None:
        """Drop the command in force and enter DISARMED: the vibration fades to zero at the exciter's rate."""
        self._memory["command_block"] = NO_COMMAND
        self.apply_order(LEAVE)

    @property
    def at_rest(self) -> bool:
        """Whether the guard allows no vibration and the device executes none, or the exciter was switched off."""
        return self._guard_state["amplitude_m"][0] == 0.0 and (
            self._silent_since_s is not None or self._block.amplitude == 0.0
        )

    def problems(self) -> list[Problem]:
        """Codes, texts and numbers of new problems with the device, and its measured rate."""
        problems, self._problems = self._problems, []
        return problems

    def close(self) -> None:
        """Bring the exciter to rest and disconnect."""
        self._rest()
        self._device.close()
