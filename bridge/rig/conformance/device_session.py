"""One session with a device: rest, tones, steps, and each way to end a vibration."""

import contextlib
import math
import threading
import time
from collections.abc import Callable
from typing import Any, cast

import numpy as np

from bridge.guard.absent import absent
from bridge.rig.conformance.heard import Block, Stage
from bridge.rig.conformance.session import REST_S, Ended, Facts, Session, tones_and_steps
from bridge.rig.derived import Derived
from bridge.rig.device import Device, DeviceBlock, DeviceError, reason_of, wrong_shape
from bridge.rig.file import DeviceRig
from bridge.wire.channels import CHANNELS

_PAUSE_BLOCKS = 30  # blocks that the device makes during a pause of the reader
_MOST_WAITING = 2000  # blocks that may wait after `open`
_PATIENCE_S = 1.0  # longest wait for a block
_HUNG_S = 3.0  # time beyond the longest `read` after which a call counts as hung


def facts_of(rig: DeviceRig, device: Device) -> Facts:
    """The facts in a rig file and an adapter."""
    return Facts(
        rig.converter.sample_rate_Hz,
        rig.converter.samples_per_block,
        rig.vibration_limits,
        rig.guard.check_share,
        rig.guard.exciter_gain,
        rig.guard.fastest_drive_mps or math.inf,
        frozenset(absent(rig.channels)),
        {name: (channel.lowest, channel.highest) for name, channel in rig.channels.items()},
        0 if device.pace == "caller" else 1,
        device.slowest_answer_s,
        frozenset(rig.derived),
        rig.exciter.watchdog_s,
        rig.exciter.enable_line,
    )


class DeviceSession:
    """Holds the session of a device."""

    def __init__(self, device: Device, rig: DeviceRig) -> None:
        self._device, self._rig = device, rig
        self._derived = Derived(rig)
        self._unit_m = rig.exciter.stroke_m_per_V or 1.0
        self.session = Session(facts_of(rig, device), device.pace)
        self._number = -1
        self._toggle = 0
        self._calling: tuple[str, float] | None = None
        self._is_open = False

    def run(self) -> Session:
        """The session; a call that does not return ends it."""
        thread = threading.Thread(target=self._run, daemon=True, name="conformance")
        thread.start()
        while thread.is_alive():
            thread.join(0.05)
            calling = self._calling
            if calling is not None and time.monotonic() - calling[1] > self._device.longest_read_s + _HUNG_S:
                self.session.failures[calling[0]] = (
                    f"{calling[0]} did not return within {self._device.longest_read_s + _HUNG_S:.1f} s"
                )
                break
        return self.session

    def _run(self) -> None:
        try:
            self._stages()
        except Ended:
            pass
        finally:
            if self._is_open:
                with contextlib.suppress(Ended):
                    self._call("safe", self._device.safe)
                with contextlib.suppress(Ended):
                    self._call("close", self._device.close)

    def _stages(self) -> None:
        facts, device = self.session.facts, self._device
        first_Hz = facts.tones_Hz[0]
        most_m, settled_s = facts.amplitude_m, facts.ramp_s + facts.answer_s + 0.02
        self._call("open", device.open)
        self._is_open = True
        self._drain()
        self._collect("rest", REST_S, first_Hz, 0.0)
        self._pause()
        for stage in tones_and_steps(facts, settled_s):
            self._collect(*stage)
        if facts.has_line:
            self._collect("off", settled_s + 0.02, first_Hz, most_m, on=False)
        self._collect("before safe", settled_s, first_Hz, most_m)
        self._after_safe(settled_s)
        if device.pace == "device" and facts.watchdog_s > 0.0:
            self._collect("before silence", settled_s, first_Hz, most_m)
            self._collect("silence", facts.watchdog_s + facts.ramp_s + 0.05, first_Hz, most_m, feeds=False)
        self._collect("before close", settled_s, first_Hz, most_m)
        self._close_and_open(facts.ramp_s + 0.02)

    def _call(self, name: str, function: Callable[[], Any]) -> Any:
        begun_s = time.monotonic()
        self._calling = name, begun_s
        try:
            return function()
        except Exception as error:
            if isinstance(error, DeviceError) and error.code == "DEVICE_DATA":
                self.session.bad_block = str(error)
            else:
                self.session.failures.setdefault(name, reason_of(error))
            raise Ended(name) from None
        finally:
            self._calling = None
            if name in self.session.longest_s:
                self.session.longest_s[name].append(time.monotonic() - begun_s)

    def _write(self, frequency_Hz: float, amplitude_m: float, on: bool = True) -> None:
        device, amplitude = self._device, amplitude_m / self._unit_m
        self._toggle = 1 - self._toggle
        if self.session.facts.has_line:
            self._call("enable", lambda: device.enable(on, self._toggle))
        self._call("write", lambda: device.write(frequency_Hz, amplitude))

    def _read(self) -> DeviceBlock | None:
        block = self._call("read", self._device.read)
        self.session.problems += [f"{code}: {text}" for code, text in self._device.problems()]
        return block

    def _next(self) -> DeviceBlock:
        until_s = time.monotonic() + _PATIENCE_S
        while (block := self._read()) is None:
            if time.monotonic() > until_s:
                why = "".join(f", {problem}" for problem in self.session.problems[-1:])
                self.session.failures.setdefault("read", f"no block within {_PATIENCE_S:g} s{why}")
                raise Ended
        return block

    def _newest(self, stage: Stage) -> None:
        """Add all waiting blocks to a stage."""
        for _ in range(_MOST_WAITING):
            block = self._next()
            self._keep(stage, block)
            if not block.waiting:
                return
        self.session.failures.setdefault("read", f"after {_MOST_WAITING} blocks, others wait")
        raise Ended

    def _keep(self, stage: Stage, block: DeviceBlock) -> None:
        """Add a block to a stage, with a copy of its samples, as an adapter may use its array again."""
        session, rig = self.session, self._rig
        # an adapter may return anything
        kind = getattr(cast("object", block.samples), "dtype", type(block.samples).__name__)
        if wrong := wrong_shape(block.samples, self._device.setup) or (
            "" if kind == np.float64 else f"samples of {kind}"
        ):
            session.bad_block = f"{wrong}, in place of an array of float64"
            raise Ended
        if block.lost < 0 or block.waiting < 0:
            session.bad_count = f"lost = {block.lost}, waiting = {block.waiting}: must not be negative"
        values, rows = np.zeros((len(CHANNELS), session.facts.samples)), self._derived(block.samples)
        for name, row in rig.rows.items():
            channel = rig.channels[name]
            values[CHANNELS.index(name)] = channel.sign * channel.scale * rows[row] + channel.offset
        self._number += 1 + block.lost
        session.lost += block.lost
        stage.append(
            Block(
                self._number, time.monotonic(), values, float(block.frequency_Hz), float(block.amplitude) * self._unit_m
            )
        )

    def _drain(self) -> None:
        """Read the blocks from before the session."""
        self._write(self.session.facts.tones_Hz[0], 0.0)
        self._newest([])
        self.session.problems.clear()
        self.session.lost = 0

    def _collect(
        self, name: str, for_s: float, frequency_Hz: float, amplitude_m: float, on: bool = True, feeds: bool = True
    ) -> None:
        stage: Stage = []
        self.session.stages.setdefault(name, []).append(stage)
        for _ in range(max(round(for_s / self.session.facts.block_s), 4)):
            if feeds:
                self._write(frequency_Hz, amplitude_m, on)
            if self._device.pace == "computer":
                time.sleep(self.session.facts.block_s)
            self._keep(stage, self._next())

    def _pause(self) -> None:
        """Read nothing for some blocks; then the device reports each of them, as waiting or as lost."""
        if self._device.pace != "device":
            return
        session, stage, before, lost = self.session, Stage(), self._number, self.session.lost
        begun_s = time.monotonic()
        time.sleep(_PAUSE_BLOCKS * session.facts.block_s)
        self._newest(stage)
        session.passed_blocks = (stage[-1].at_s - begun_s) / session.facts.block_s
        session.seen_blocks = self._number - before
        session.lost = lost  # of the pause: a device may lose blocks if it reports them

    def _after_safe(self, for_s: float) -> None:
        stage: Stage = []
        self.session.stages["safe"] = [stage]
        self._call("safe", self._device.safe)
        for _ in range(max(round(for_s / self.session.facts.block_s), 4)):
            block = self._read()
            if block is None:
                return
            self._keep(stage, block)
            if self._device.pace == "caller":  # it makes a block for each order
                self._call("safe", self._device.safe)

    def _close_and_open(self, for_s: float) -> None:
        """Look at the first blocks after another `open`, without an order in between."""
        stage: Stage = []
        self.session.stages["closed"] = [stage]
        self._call("close", self._device.close)
        self._is_open = False
        time.sleep(for_s)
        self._call("close", self._device.open)  # resources that `close` did not release
        self._is_open = True
        if self._device.pace == "device":
            self._newest(stage)
        elif (block := self._read()) is not None:
            self._keep(stage, block)
