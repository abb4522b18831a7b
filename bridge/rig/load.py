"""The device of a rig file, by the adapter that it names. Nothing here needs compiled kernels."""

import importlib
import importlib.util
from pathlib import Path
from types import ModuleType

from bridge.faults import Fault
from bridge.rig.device import Device, Setup
from bridge.rig.file import DeviceRig


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
