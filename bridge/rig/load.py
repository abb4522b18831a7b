"""The device of a rig file, by the adapters that it names. Nothing here needs compiled kernels."""

import importlib
import importlib.util
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

from bridge.faults import Fault
from bridge.rig.device import Device, Exciter, Pair, Part, Setup
from bridge.rig.file import DeviceRig

_Kind = TypeVar("_Kind", bound=Part)


def device_of(rig: DeviceRig, folder: Path) -> Device:
    """The device of a rig, not open. Raises Fault CONFIG for an unknown adapter, a missing driver, or its settings."""
    device = _made(Device, rig, folder, "adapter", rig.adapter, rig.device)
    if not rig.exciter.adapter:
        return device
    return Pair(device, _made(Exciter, rig, folder, "exciter.adapter", rig.exciter.adapter, rig.exciter.device))


def _made(kind: type[_Kind], rig: DeviceRig, folder: Path, key: str, name: str, settings: Mapping[str, Any]) -> _Kind:
    place = f"{rig.name}: {key} = {name!r}"
    adapter = getattr(_module(place, name, folder), "Adapter", None)
    if not (isinstance(adapter, type) and issubclass(adapter, kind)):
        line = f"{place}: must have a class Adapter that derives from bridge.rig.device.{kind.__name__}"
        raise Fault("CONFIG", f"{line}; add it")
    converter, exciter = rig.converter, rig.exciter
    return adapter(
        Setup(
            settings,
            folder,
            converter.sample_rate_Hz,
            converter.samples_per_block,
            rig.sources,
            exciter.enable_line,
            exciter.stroke_m_per_V is not None,
        )
    )


def _module(place: str, name: str, folder: Path) -> ModuleType:
    try:
        if not name.endswith(".py"):
            return importlib.import_module(f"bridge.rig.adapters.{name}")
        spec = importlib.util.spec_from_file_location("adapter", folder / name)
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
