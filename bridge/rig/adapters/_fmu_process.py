"""`python -m bridge.rig.adapters._fmu_process SETTINGS FOLDER`: a model in a separate process, with numpy and FMPy alone.

For each order, four float64 (frequency, amplitude, speed, load; NaN: no such input), it answers with the float64 samples of the
block, [outputs][samples]. It ends with a line on stderr that gives the reason.
"""

import ctypes
import json
import math
import os
import re
import resource
import struct
import sys
import zipfile
from typing import Any

import numpy as np

ORDER = struct.Struct("<4d")
READY = b"ready\n"
_LOOK_BLOCKS = 10  # blocks from a look at the memory to the next; it takes 15 us
_ERROR = 3  # status of FMI
_HEAD_BYTES = 1 << 16  # part of the description in which its version is


class _Absent:
    """A function that the library of a model lacks."""

    restype: Any = None

    def __call__(self, *_: object) -> int:
        return _ERROR


class _Library:
    """The library of a model. FMPy asks for every function of FMI; an absent function fails once it is called."""

    def __init__(self, library: Any) -> None:
        self._library = library

    def __getattr__(self, name: str) -> Any:
        return getattr(self._library, name, None) or _Absent()


class Model:
    """The running model. Raises ValueError if it does not fit the settings."""

    def __init__(self, settings: dict[str, Any], folder: str) -> None:
        from fmpy import extract, read_model_description  # pyright: ignore[reportMissingImports]  # an extra
        from fmpy.fmi2 import FMU2Slave  # pyright: ignore[reportMissingImports]
        from fmpy.fmi3 import FMU3Slave  # pyright: ignore[reportMissingImports]

        kinds: dict[str, Any] = {"2.0": FMU2Slave, "3.0": FMU3Slave}
        with zipfile.ZipFile(settings["file"]) as archive, archive.open("modelDescription.xml") as file:
            stated = re.search(rb'fmiVersion\s*=\s*"([^"]*)"', file.read(_HEAD_BYTES))
            platforms = {name.split("/")[1] for name in archive.namelist() if name.startswith("binaries/")}
        fmi = stated[1].decode() if stated else "unknown"
        about = read_model_description(settings["file"], validate=False) if fmi in kinds else None
        if about is None or about.coSimulation is None:
            raise ValueError(f"FMI {fmi}: must be a model of FMI 2.0 or 3.0 for co-simulation")
        if (platform := {"2.0": "linux64", "3.0": "x86_64-linux"}[fmi]) not in platforms:
            raise ValueError(
                f"binaries/{platform}: no binary for Linux on x86-64; has {', '.join(platforms) or 'none'}"
            )
        extract(settings["file"], folder)
        variables = {variable.name: variable for variable in about.modelVariables}
        names = [settings["frequency"], settings["amplitude"], *settings["set"], *settings["outputs"]]
        if missing := [name for name in names if name not in variables]:
            raise ValueError(f"{missing[0]}: no such variable; known: {', '.join(variables)}")
        if wrong := [name for name in names if variables[name].type not in {"Real", "Float64"}]:
            raise ValueError(f"{wrong[0]}: is {variables[wrong[0]].type}: must be a real number of 64 bits")
        sizes = {
            int(np.prod([int(d.start) for d in variables[name].dimensions] or [1])) for name in settings["outputs"]
        }
        samples, size = int(settings["samples"]), max(sizes)
        if len(sizes) > 1 or samples % size:
            counts = " and ".join(str(size) for size in sorted(sizes))
            raise ValueError(f"outputs of {counts} samples: must all have one number that divides {samples}, a block")
        self._steps = samples // size
        self._step_s = settings["block_s"] / self._steps
        self._count = 0

        class Lenient(kinds[fmi]):
            def _loadFunctions(self) -> None:
                self.dll: Any = _Library(self.dll)
                super()._loadFunctions()

        Lenient.__name__ = kinds[fmi].__name__  # by which FMPy knows the version
        model: Any = Lenient(
            guid=about.guid,
            unzipDirectory=folder,
            modelIdentifier=about.coSimulation.modelIdentifier,
            instanceName="rig",
        )
        model.instantiate()
        if fmi == "2.0":
            model.setupExperiment(startTime=0.0)
        model.enterInitializationMode()
        references = {name: variable.valueReference for name, variable in variables.items()}
        (model.setReal if fmi == "2.0" else model.setFloat64)(
            [references[name] for name in settings["set"]], [*settings["set"].values()]
        )
        model.exitInitializationMode()
        # kept for all steps: FMPy's own `setFloat64` and `getFloat64` make new ones
        inputs = [*names[:2], *(settings[name] for name in ("speed", "load") if settings[name])]
        self._order = (ctypes.c_double * len(inputs))()
        parts: Any = (ctypes.c_double * (len(settings["outputs"]) * size))()
        self._part = np.frombuffer(parts).reshape(-1, size)
        self._block = np.empty((len(settings["outputs"]), self._steps, size))
        lengths = [[len(values)] if fmi == "3.0" else [] for values in (self._order, parts)]
        of_inputs, of_outputs = [
            (ctypes.c_uint * len(names))(*(references[name] for name in names))
            for names in (inputs, settings["outputs"])
        ]
        put, get = (
            (model.fmi2SetReal, model.fmi2GetReal) if fmi == "2.0" else (model.fmi3SetFloat64, model.fmi3GetFloat64)
        )
        self._put = lambda: put(model.component, of_inputs, len(inputs), self._order, *lengths[0])
        self._get = lambda: get(model.component, of_outputs, len(of_outputs), parts, *lengths[1])
        self._model = model

    def block(self, *order: float) -> bytes:
        """The samples of the next block."""
        self._order[:] = [value for value in order if not math.isnan(value)]
        self._put()
        for step in range(self._steps):
            self._model.doStep(self._count * self._step_s, self._step_s)
            self._count += 1
            self._part.fill(math.nan)  # a model that states more values than it has
            self._get()
            self._block[:, step] = self._part
        return self._block.tobytes()


def _memory_bytes() -> int:
    with open("/proc/self/statm", "rb") as file:
        return int(file.read().split()[0]) * resource.getpagesize()


def _serve(settings: dict[str, Any], folder: str) -> None:
    """Answer orders until stdin ends; the model is unpacked into `folder`."""
    answers = os.dup(1)
    os.dup2(2, 1)  # the prints of a model must not mix with the samples
    try:
        model = Model(settings, folder)
        start, most = _memory_bytes(), round(settings["memory_MB"] * 1e6)
        # within one step the system refuses more
        resource.setrlimit(resource.RLIMIT_AS, (start + 2 * most, start + 2 * most))
        os.write(answers, READY)
        blocks = 0
        with open(0, "rb", buffering=0) as orders:
            while len(order := orders.read(ORDER.size)) == ORDER.size:
                answer = memoryview(model.block(*ORDER.unpack(order)))
                blocks += 1
                if blocks % _LOOK_BLOCKS == 0 and (grown := _memory_bytes() - start) > most:
                    raise MemoryError(f"it grew by {grown / 1e6:.0f} MB: must be at most memory_MB = {most / 1e6:g}")
                while answer:
                    answer = answer[os.write(answers, answer) :]
    except Exception as error:  # any of FMPy, of the archive or of the model
        needed = isinstance(error, ModuleNotFoundError)
        why = (
            f"needs the package {error.name}; pip install 'stickslip[fmi]'"
            if needed
            else f"{type(error).__name__}: {error}"
        )
        print(why, file=sys.stderr, flush=True)
        os.close(answers)  # at once: the end of an interpreter takes longer
        raise SystemExit(1) from None


if __name__ == "__main__":
    _serve(json.loads(sys.argv[1]), sys.argv[2])
