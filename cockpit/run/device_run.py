"""A run of a real rig: its rig file, and the scenario's controller, duration, bus and log. Nothing here imports the plant."""

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import model_validator

from bridge.config import made_with, validate, with_overrides
from bridge.faults import Fault
from bridge.guard.absent import absent
from bridge.rig.faults.kinds import EXCITER
from bridge.rig.file import DeviceRig
from bridge.wire import stickslip_pb2 as wire
from cockpit.run.run_tables import RunTables, header_of
from cockpit.run.scenario_file import RIG_FILE, find, is_real_rig, path_of_rig, read_scenario, rig_table, with_rig
from controller.config import AmplitudeConfig, seeing, within

# The default scenario describes the paper's simulated rig; a real rig without another scenario runs with the controller's
# defaults until Ctrl-C.
DEFAULT_SCENARIO = "paper-c45-c45"


class DeviceRun(RunTables):
    """Configuration of one run of a real rig; the rig file sets the controller's blocks, channels and limits."""

    rig: DeviceRig

    @model_validator(mode="after")
    def _fits_together(self) -> "DeviceRun":
        if self.arm:
            raise ValueError(
                "arm = true: a real rig is armed by an operator alone; leave it out, and use `stickslip arm`"
            )
        self.refuse_faults_of(absent(self.rig.channels))
        controller, converter = self.controller, self.rig.converter
        blocks = {"block_s": converter.block_s, "samples_per_block": converter.samples_per_block}
        for name, of_rig in blocks.items():
            given = getattr(controller, name)
            if name in controller.model_fields_set and given != of_rig:
                raise ValueError(
                    f"controller.{name} = {given}: must equal {of_rig}, from [converter] of the rig; leave it out"
                )
        try:
            accelerometer = {"amplitude": self._amplitude(controller.amplitude)}
            controller = seeing(controller.model_copy(update=blocks | accelerometer), absent(self.rig.channels))
            return self.model_copy(update={"controller": within(controller, self.rig.vibration_limits)})
        except ValueError as error:
            raise ValueError(f"controller.{error}") from None

    @property
    def simulated_only(self) -> str:
        """The first of its tables that only a simulated rig carries out."""
        return self.refused_by(is_model=False)

    def refused_by(self, is_model: bool, settable: Collection[str] = ()) -> str:
        """The first of its tables that its device does not carry out, as text; empty if it can run.

        Args:
            is_model: the device is a model, so that its exciter may have faults.
            settable: as of `bridge.rig.device.Device`.

        """
        for number, fault in enumerate(self.fault):
            if fault.group == EXCITER and not is_model:
                return f"fault.{number}.target = {fault.target}: must be a sensor, clock or bus: this rig is real"
        for number, step in enumerate(self.step):
            needed = {"speed": step.speed_mps, "load": step.load}
            if any(value is not None and name not in settable for name, value in needed.items()):
                return (
                    f"step.{number}: speed and load of a real rig are set by its machine: must be command or settings"
                )
        return ""

    def _amplitude(self, given: AmplitudeConfig) -> AmplitudeConfig:
        """The table with bandwidth and range of the base accelerometer, where it does not give them."""
        base = self.rig.channels["base_accel_mps2"]
        ends = [abs(end) for end in (base.lowest, base.highest) if end is not None]
        stated = {"accel_bandwidth_Hz": base.bandwidth_Hz, "accel_range_mps2": min(ends, default=None)}
        known = {key: value for key, value in stated.items() if value and key not in given.model_fields_set}
        return given.model_copy(update=known)


class _Tables(NamedTuple):
    """The tables of a run, and their files."""

    run: dict[str, Any]
    source: str  # names of the files
    folder: Path  # of the rig file


def is_real(name: str, settings: Sequence[str]) -> bool:
    """Whether the scenario and the settings name a real rig. Raises Fault CONFIG."""
    return is_real_rig(_tables(name, settings).run.get("rig"))


def load_device_run(name: str, settings: list[str]) -> tuple[DeviceRun, Path]:
    """A run of a real rig by scenario and settings, and the folder of its rig file. Raises Fault CONFIG."""
    of_rig = [setting for setting in settings if setting.startswith((RIG_FILE, "arm="))]
    _, source, folder = _tables(name, settings)

    def make(given: Sequence[str]) -> DeviceRun:
        return validate(DeviceRun, _tables(name, given).run, source)

    return made_with(make, source, settings, of_rig), folder


def load_device_rig(name: str, settings: list[str]) -> tuple[DeviceRig, Path]:
    """A real rig by name or path with `key=value` settings, and the folder of its file. Raises Fault CONFIG."""
    path = find(name, "rigs")
    table = rig_table(path)
    if not is_real_rig(table):
        raise Fault("CONFIG", f"{path.name}: adapter: not given: is a simulated rig; name the adapter of a real rig")

    def make(given: Sequence[str]) -> DeviceRig:
        return validate(DeviceRig, with_overrides(table, given), path.name)

    return made_with(make, path.name, settings), path.absolute().parent


def _tables(name: str, settings: Sequence[str]) -> _Tables:
    path, given = read_scenario(name)
    table = with_overrides(given, settings)
    rig_path = path_of_rig(path, table)
    run, source = with_rig(path, table)
    rig: Any = run.get("rig")
    if name == DEFAULT_SCENARIO and is_real_rig(rig):
        bare = {"name": str(rig.get("name", "unnamed")), "duration_s": 0.0, "rig": {}}
        run = with_overrides(bare, settings) | {"rig": rig}
    return _Tables(run, source, (rig_path or path).absolute().parent)


def device_header(run: DeviceRun, role: str, lockstep: bool) -> wire.Header:
    """The header of a process of this run: role, configuration and versions."""
    rig = run.rig
    faults = {"fault": [table.model_dump(mode="json") for table in run.fault]} if run.fault else {}
    return header_of(run, rig.header(), rig.vibration_limits, rig.name, role, lockstep, faults)
