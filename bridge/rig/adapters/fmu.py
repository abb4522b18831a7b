"""A model of another tool as a device: an FMU of FMI 2 or 3 for co-simulation, run by FMPy in a separate process.

The process may crash, hang or grow: it is ended and reported, and is not started again in this run. One block is one step of the
model, whose outputs are arrays of its samples, or a step for each part of it. The experiment that the model proposes is ignored.
"""

import json
import math
import os
import select
import subprocess
import sys
import tempfile
from contextlib import suppress
from typing import IO, Annotated

import numpy as np
from pydantic import Field, model_validator

from bridge.config import Strict, validate
from bridge.rig.adapters._fmu_process import ORDER, READY
from bridge.rig.device import Device, DeviceBlock, DeviceError, Setup

# Longest time [s] until a model has begun: it is unpacked and FMPy is loaded, 0.6 s of CPU; the rest is for a busy computer.
_OPEN_S = 300.0
_END_S = 1.0  # longest wait for the end of the process


class FmuSettings(Strict):
    """The table `[device]`."""

    file: str = Field(description="The FMU; a relative path begins at the rig file.")
    frequency: str = Field(description="Input of the exciter's frequency [Hz].")
    amplitude: str = Field(description="Input of the exciter's amplitude, in metres or as `stroke_m_per_V` scales it.")
    outputs: Annotated[list[str], Field(min_length=1)] = Field(
        description="Outputs that make the device's channels 0, 1 and so on."
    )
    set: dict[str, float] = Field({}, description="Start values of inputs and parameters, by name.")
    speed: str = Field(
        "", description="Input of the drive's speed, with a start value in `set`: a `[[step]]` changes it."
    )
    units_per_mps: float = Field(1.0, description="Value of this input for 1 m/s.")
    load: str = Field("", description="Input of the normal load, with a start value in `set`: a `[[step]]` changes it.")
    noise: dict[str, float] = Field({}, description="Standard deviation of the noise of an output, in its unit.")
    resolution: dict[str, float] = Field({}, description="Step of an output's values, in its unit.")
    seed: Annotated[int, Field(ge=0)] = 1
    slowest_s: Annotated[float, Field(gt=0)] = Field(
        1.5, description="Time for a block after which the model is ended, as MODEL_SLOW."
    )
    memory_MB: Annotated[float, Field(gt=0)] = Field(200.0, description="Largest growth of its memory after its start.")

    @model_validator(mode="after")
    def _has_start_values(self) -> "FmuSettings":
        for name in ("speed", "load"):
            if (variable := getattr(self, name)) and variable not in self.set:
                raise ValueError(f"{name} = {variable!r}: must have its start value in set; add it")
        return self


class Adapter(Device):
    """The model; a block is made for each `write`."""

    pace = "caller"

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        self._settings = settings = validate(FmuSettings, dict(setup.settings), "device")
        self._shape = len(settings.outputs), setup.samples_per_block
        self._process: subprocess.Popen[bytes] | None = None
        self._errors: IO[bytes] | None = None
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._end: DeviceError | None = None
        self._order, self._is_on = (0.0, 0.0), not setup.has_enable_line
        self.watchdog_s = self.block_s  # it makes no block without an order
        self.settable = frozenset(name for name in ("speed", "load") if getattr(settings, name))
        self._machine = self._start()

    def open(self) -> None:
        """Start the process, and the model from its beginning. Raises DeviceError once it has died."""
        if self._end is not None:
            raise DeviceError(f"{self._end}, and is not started again", self._end.code)
        settings = self._settings.model_dump() | {
            "file": str(self.setup.folder / self._settings.file),
            "block_s": self.block_s,
            "samples": self.setup.samples_per_block,
        }
        self._machine = self._start()
        self._random = np.random.Generator(np.random.PCG64(self._settings.seed))
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115  # closed by `close`
        self._folder = tempfile.TemporaryDirectory(prefix="stickslip-fmu-")  # removed by `close`, also after a crash
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "bridge.rig.adapters._fmu_process", json.dumps(settings), self._folder.name],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
        )
        try:
            if self._answer(len(READY), _OPEN_S) != READY:
                raise self._died()
        except DeviceError as error:
            self.close()
            raise DeviceError(f"{self._settings.file}: {error}", error.code) from None

    def read(self) -> DeviceBlock:
        """The block of the newest order."""
        if self._process is None or self._process.stdin is None:
            raise self._died()
        size = 8 * self._shape[0] * self._shape[1]
        try:
            with suppress(BrokenPipeError):  # it has ended, as the answer shows
                os.write(self._process.stdin.fileno(), ORDER.pack(*self._order, *self._machine.values()))
            rows = np.frombuffer(self._answer(size, self._settings.slowest_s)).reshape(self._shape)
        except DeviceError as error:
            self._end = error
            raise
        return DeviceBlock(self._measured(rows), *self._order)

    def _measured(self, rows: np.ndarray) -> np.ndarray:
        """The outputs with noise and resolution."""
        settings, rows = self._settings, rows.copy()
        for row, name in enumerate(settings.outputs):
            if sigma := settings.noise.get(name, 0.0):
                rows[row] += sigma * self._random.standard_normal(self._shape[1])
            if step := settings.resolution.get(name, 0.0):
                rows[row] = np.round(rows[row] / step) * step
        return rows

    def _answer(self, size: int, longest_s: float) -> bytes:
        process = self._process
        if process is None or process.stdout is None:
            raise self._died()
        number, received = process.stdout.fileno(), b""
        while len(received) < size:
            if not select.select([number], [], [], longest_s)[0]:
                process.kill()
                raise DeviceError(f"no block within {longest_s:g} s: ended", "MODEL_SLOW")
            piece = os.read(number, size - len(received))
            if not piece:
                raise self._died()
            received += piece
        return received

    def _died(self) -> DeviceError:
        """The error of a process that has ended, with the last line that it wrote."""
        status, line = None, ""
        if self._process is not None:
            with suppress(subprocess.TimeoutExpired):
                status = self._process.wait(_END_S)
        if self._errors is not None and not self._errors.closed:
            self._errors.seek(0)
            lines = self._errors.read().decode(errors="replace").strip().splitlines()
            line = lines[-1] if lines else ""
        ended = f"ended by signal {-status}" if status is not None and status < 0 else "ended"
        return DeviceError(f"the model {ended}{f': {line}' if line else ''}", "MODEL_DIED")

    def write(self, frequency_Hz: float, amplitude: float) -> None:
        """Set the order of the next block."""
        self._order = frequency_Hz, amplitude if self._is_on else 0.0

    def _start(self) -> dict[str, float]:
        """Start values of speed and load, in the model's units; NaN: the model has no such input."""
        settings = self._settings
        return {name: settings.set.get(getattr(settings, name), math.nan) for name in ("speed", "load")}

    @property
    def speed_mps(self) -> float:
        """Velocity of the drive [m/s]."""
        return self._machine["speed"] / self._settings.units_per_mps

    def set(self, name: str, value: float) -> None:
        """Set speed or load for the coming blocks."""
        factor = self._settings.units_per_mps if name == "speed" else self._start()[name]
        self._machine[name] = factor * value

    def enable(self, on: bool, toggle: int) -> None:  # noqa: ARG002
        """Set the enable line, without which the model rests."""
        self._is_on = on

    def safe(self) -> None:
        """Rest in the next block."""
        self._order = self._order[0], 0.0

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            for pipe in (self._process.stdin, self._process.stdout):
                if pipe is not None:
                    with suppress(OSError):
                        pipe.close()
            self._process.kill()
            self._process.wait()
        if self._errors is not None:
            self._errors.close()
        if self._folder is not None:
            self._folder.cleanup()
        self._process = None
