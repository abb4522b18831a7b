"""A real rig behind its guard, from its rig file: its device, opened, with calibration and limits."""

import math
from collections.abc import Sequence
from pathlib import Path

from bridge.arrays import Records
from bridge.faults import Fault
from bridge.guard.absent import absent
from bridge.guard.records import ExciterLimits, build
from bridge.guard.wide import protection
from bridge.rig.derived import Derived
from bridge.rig.device import Device, reason_of
from bridge.rig.device_node import DeviceNode
from bridge.rig.faults.exciter import SpoiledExciter
from bridge.rig.faults.schedule import Faults
from bridge.rig.faults.table import FaultTable
from bridge.rig.file import DeviceRig
from bridge.rig.load import device_of
from bridge.rig.node import Served
from bridge.rig.step import device_memory
from bridge.wire.channels import CHANNELS, SENSOR_CHANNELS
from bridge.wire.clock import time

# Longest wait for the first block. Smaller: a program that starts shows a wrong frame only after the rig runs. Larger: the
# process of a rig whose device is silent joins the bus as much later.
_FIRST_BLOCK_S = 1.0


def served(rig: DeviceRig, folder: Path, faults: Sequence[FaultTable] = (), seed: int = 0) -> Served:
    """A real rig for `bridge.rig.process.serve`, with injected faults; it never starts ARMED."""

    def make(run: int, _may_arm: bool) -> DeviceNode:
        return open_node(rig, folder, run, faults, seed)

    return Served(rig.name, rig.guard, notes(rig, device_of(rig, folder).watchdog_s), make)


def open_node(
    rig: DeviceRig, folder: Path, run: int, faults: Sequence[FaultTable] = (), seed: int = 0, arm: bool = False
) -> DeviceNode:
    """The node of a rig whose device is open. Raises Fault CONFIG, NO_DEVICE; a rig that cannot be opened is never simulated.

    `arm`: it starts ARMED; only for a device that makes a block for each command, as a model does.
    """
    device = device_of(rig, folder)
    guard = build(rig.guard, _exciter(rig), run, arm, absent=absent(rig.channels), derived=rig.derived)
    # nothing real moves behind a device that makes a block for each command
    exciter = SpoiledExciter(device.block_s) if device.pace == "caller" else None
    block_s, samples, stroke_m = rig.converter.block_s, rig.converter.samples_per_block, rig.exciter.stroke_m_per_V
    injected = Faults(faults, seed, block_s, samples, exciter.set if exciter is not None else None)
    node = DeviceNode(device, guard, injected, calibration(rig), stroke_m or 1.0, Derived(rig), exciter)
    node.warm_up()  # before a device samples: its buffers overflow while kernels compile
    try:  # an adapter may be foreign code
        device.open()
        try:
            _hear_first_block(device)
        except BaseException:
            device.close()
            raise
    except Exception as error:
        raise Fault("NO_DEVICE", f"{rig.name}: {reason_of(error)}") from None
    return node


def _hear_first_block(device: Device) -> None:
    """Wait for a block of a device with a clock, which may be silent at first. Raises DeviceError: it cannot be this rig's."""
    until_s = time.monotonic() + _FIRST_BLOCK_S
    while device.pace == "device" and device.read() is None and time.monotonic() < until_s:
        pass


def notes(rig: DeviceRig, watchdog_s: float = 0.0) -> list[tuple[str, str]]:
    """Codes and texts of events at the start of a run: wide limits, and protection that this rig lacks.

    `watchdog_s` is the device's own watchdog, where its adapter knows it.
    """
    events = protection(rig.guard, _exciter(rig), rig.guard.fastest_drive_mps or 0.0, absent(rig.channels))
    events += [
        ("UNPROTECTED", f"{name} is derived, so that it contradicts no other channel: {SENSOR_CHANNELS[name].guards}")
        for name in rig.derived
    ]
    if not rig.exciter.enable_line:
        events.append(("UNPROTECTED", "no enable line: the loop check finds no exciter that cannot be switched off"))
    if not (rig.exciter.watchdog_s or watchdog_s):
        events.append(("UNPROTECTED", "no watchdog: a killed process leaves the exciter vibrating"))
    return events


def calibration(rig: DeviceRig) -> Records:
    """The wiring and calibration of the channels, as the memory of a `DeviceNode`."""
    memory = device_memory()
    for row, name in enumerate(CHANNELS):
        channel = rig.channels[name]
        memory["source"][0, row] = rig.rows.get(name, -1)
        memory["scale"][0, row], memory["offset"][0, row] = channel.sign * channel.scale, channel.offset
        memory["range_low"][0, row] = -math.inf if channel.lowest is None else channel.lowest
        memory["range_high"][0, row] = math.inf if channel.highest is None else channel.highest
    return memory


def _exciter(rig: DeviceRig) -> ExciterLimits:
    return ExciterLimits.of(rig.exciter, rig.converter.block_s, rig.converter.samples_per_block)
