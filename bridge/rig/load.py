"""The adapter that a rig file names, and the node of a real rig."""

import importlib
import importlib.util
from pathlib import Path
from types import ModuleType

from bridge.faults import Fault
from bridge.guard.absent import absent
from bridge.guard.records import build
from bridge.rig.device import Device, DeviceError, Setup
from bridge.rig.faults.schedule import Faults
from bridge.rig.file import DeviceRig
from bridge.rig.node import DeviceNode
from bridge.rig.process import Served


def device_of(rig: DeviceRig, folder: Path) -> Device:
    """The device of a rig, not open. Raises Fault CONFIG for an unknown adapter, a missing driver, or its settings."""
    module = _module(rig, folder)
    adapter = getattr(module, "Adapter", None)
    if not (isinstance(adapter, type) and issubclass(adapter, Device)):
        line = f"{rig.name}: adapter = {rig.adapter!r}: must have a class Adapter that derives from bridge.rig.device.Device"
        raise Fault("CONFIG", f"{line}; add it")
    converter = rig.converter
    return adapter(
        Setup(
            rig.device,
            folder,
            converter.sample_rate_Hz,
            converter.samples_per_block,
            rig.sources,
            rig.exciter.enable_line,
        )
    )


def _module(rig: DeviceRig, folder: Path) -> ModuleType:
    place = f"{rig.name}: adapter = {rig.adapter!r}"
    try:
        if not rig.adapter.endswith(".py"):
            return importlib.import_module(f"bridge.rig.adapters.{rig.adapter}")
        spec = importlib.util.spec_from_file_location("adapter", folder / rig.adapter)
        if spec is None or spec.loader is None:
            raise Fault("CONFIG", f"{place}: cannot be read; give the path of a Python file")
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
    except ModuleNotFoundError as error:
        if str(error.name).startswith("bridge.rig.adapters."):
            known = sorted(path.stem for path in (Path(__file__).parent / "adapters").glob("[!_]*.py"))
            line = f"{place}: no such adapter; known: {', '.join(known)}; or give a file, such as './mine.py'"
            raise Fault("CONFIG", line) from None
        raise Fault("CONFIG", f"{place}: needs the package {error.name}; install it") from None
    except (OSError, SyntaxError) as error:
        raise Fault("CONFIG", f"{place}: cannot be read: {error}; correct the file") from None
    return module


def served(rig: DeviceRig, folder: Path) -> Served:
    """A real rig for `bridge.rig.process.serve`; it never starts ARMED."""
    return Served(rig.name, rig.guard, rig.notes(), lambda run, _may_arm: open_node(rig, folder, run))


def open_node(rig: DeviceRig, folder: Path, run: int) -> DeviceNode:
    """The node of a rig whose device is open. Raises Fault CONFIG, NO_DEVICE; a rig that cannot be opened is never simulated."""
    device = device_of(rig, folder)
    guard = build(rig.guard, rig.exciter_limits, run, absent=absent(rig.channels))
    faults = Faults((), 0, rig.converter.block_s, rig.converter.samples_per_block)
    try:
        device.open()
    except DeviceError as error:
        raise Fault("NO_DEVICE", f"{rig.name}: {error}") from None
    return DeviceNode(device, guard, faults, rig.memory(), rig.exciter.stroke_m_per_V or 1.0)
