"""`python -m bridge.rig.adapters._fmu_process SETTINGS`: a model in a separate process, with numpy and FMPy alone.

For each order, two float64 (frequency, amplitude), it answers with the float64 samples of the block, [outputs][samples]. It ends
with a line on stderr that gives the reason.
"""

import json
import os
import re
import resource
import struct
import sys
import tempfile
import zipfile
from typing import Any

import numpy as np

ORDER = struct.Struct("<dd")
READY = b"ready\n"
_HEAD_BYTES = 1 << 16  # part of the description in which its version is


class Model:
    """The running model. Raises ValueError if it does not fit the settings."""

    def __init__(self, settings: dict[str, Any], folder: str) -> None:
        from fmpy import extract, read_model_description  # pyright: ignore[reportMissingImports]  # an extra
        from fmpy.fmi2 import FMU2Slave  # pyright: ignore[reportMissingImports]
        from fmpy.fmi3 import FMU3Slave  # pyright: ignore[reportMissingImports]

        kinds = {"2.0": FMU2Slave, "3.0": FMU3Slave}
        with zipfile.ZipFile(settings["file"]) as archive, archive.open("modelDescription.xml") as file:
            stated = re.search(rb'fmiVersion\s*=\s*"([^"]*)"', file.read(_HEAD_BYTES))
        fmi = stated[1].decode() if stated else "unknown"
        about = read_model_description(settings["file"], validate=False) if fmi in kinds else None
        if about is None or about.coSimulation is None:
            raise ValueError(f"FMI {fmi}: must be a model of FMI 2.0 or 3.0 for co-simulation")
        extract(settings["file"], folder)
        self._is_3 = fmi == "3.0"
        variables = {variable.name: variable for variable in about.modelVariables}
        names = [settings["frequency"], settings["amplitude"], *settings["set"], *settings["outputs"]]
        if missing := [name for name in names if name not in variables]:
            raise ValueError(f"{missing[0]}: no such variable; known: {', '.join(variables)}")
        if wrong := [name for name in names if variables[name].type not in {"Real", "Float64"}]:
            raise ValueError(f"{wrong[0]}: is {variables[wrong[0]].type}: must be a real number of 64 bits")
        self._inputs = [variables[name].valueReference for name in names[:2]]
        self._outputs = [variables[name].valueReference for name in settings["outputs"]]
        sizes = {
            int(np.prod([int(d.start) for d in variables[name].dimensions] or [1])) for name in settings["outputs"]
        }
        samples, self._size = int(settings["samples"]), max(sizes)
        if len(sizes) > 1 or samples % self._size:
            counts = " and ".join(str(size) for size in sorted(sizes))
            raise ValueError(f"outputs of {counts} samples: must all have one number that divides {samples}, a block")
        self._steps = samples // self._size
        self._step_s = settings["block_s"] / self._steps
        self._count = 0
        kind: Any = kinds[fmi]
        self._model = kind(
            guid=about.guid,
            unzipDirectory=folder,
            modelIdentifier=about.coSimulation.modelIdentifier,
            instanceName="rig",
        )
        self._model.instantiate()
        if not self._is_3:
            self._model.setupExperiment(startTime=0.0)
        self._model.enterInitializationMode()
        for name, value in settings["set"].items():
            self._set([variables[name].valueReference], [value])
        self._model.exitInitializationMode()

    def _set(self, references: list[int], values: list[float]) -> None:
        (self._model.setFloat64 if self._is_3 else self._model.setReal)(references, values)

    def block(self, frequency_Hz: float, amplitude: float) -> bytes:
        """The samples of the next block."""
        self._set(self._inputs, [frequency_Hz, amplitude])
        parts: list[np.ndarray] = []
        for _ in range(self._steps):
            self._model.doStep(self._count * self._step_s, self._step_s)
            self._count += 1
            total = len(self._outputs) * self._size
            get = self._model.getFloat64 if self._is_3 else self._model.getReal
            values = get(self._outputs, nValues=total) if self._is_3 else get(self._outputs)
            parts.append(np.array(values, np.float64).reshape(len(self._outputs), self._size))
        return np.concatenate(parts, axis=1).tobytes()


def _serve(settings: dict[str, Any]) -> None:
    """Answer orders until stdin ends."""
    answers = os.dup(1)
    os.dup2(2, 1)  # the prints of a model must not mix with the samples
    most = round(settings["memory_MB"] * 1e6)
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    with tempfile.TemporaryDirectory(prefix="stickslip-fmu-") as folder:
        try:
            model = Model(settings, folder)
        except ModuleNotFoundError as error:
            raise SystemExit(f"needs the package {error.name}; pip install 'stickslip[fmi]'") from None
        except Exception as error:  # any of FMPy, of the archive or of the model
            raise SystemExit(f"{type(error).__name__}: {error}") from None
        os.write(answers, READY)
        with open(0, "rb", buffering=0) as orders:
            while len(order := orders.read(ORDER.size)) == ORDER.size:
                answer = memoryview(model.block(*ORDER.unpack(order)))
                while answer:
                    answer = answer[os.write(answers, answer) :]


if __name__ == "__main__":
    _serve(json.loads(sys.argv[1]))
