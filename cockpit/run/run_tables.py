"""The tables of a scenario that runs of simulated and of real rigs share, and the headers of their processes."""

import json
import math
import platform
from collections.abc import Collection
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import AfterValidator, Field, model_validator

from bridge.config import Strict
from bridge.faults import Fault
from bridge.guard.config import VibrationLimits
from bridge.log.storage.log_files import Rotation
from bridge.rig.faults.kinds import PROCESS
from bridge.rig.faults.table import FaultTable
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.payloads import SCHEMA_VERSION
from bridge.wire.zenoh_link import BusConfig
from cockpit.expect.tables import ExpectTable, MutantTable
from cockpit.run.scenario_file import Sweeps
from cockpit.run.step import StepTable, configurations
from controller.config import ControllerConfig


def _plain(name: str) -> str:
    if name in {"", ".", ".."} or "/" in name or not name.isprintable():
        rule = "must be a plain file name, as the log is runs/NAME.mcap"
        raise ValueError(f"{name!r}: {rule}; leave out every / and control character")
    return name


class LogTable(Strict):
    """Limits of a file of the log; the log continues in `NAME-0001.mcap` and so on."""

    file_MB: Annotated[float, Field(ge=0)] = Field(default=1000.0, description="Largest size of a file; 0: no limit.")
    file_s: Annotated[float, Field(ge=0)] = Field(default=3600.0, description="Longest time in a file; 0: no limit.")

    @property
    def rotation(self) -> Rotation:
        """The limits in the units of the log writer."""
        return Rotation(round(self.file_MB * 1e6), self.file_s)


class RunTables(Sweeps):
    """Configuration of one run without its rig."""

    name: Annotated[str, AfterValidator(_plain)] = "unnamed"
    description: str = ""
    duration_s: Annotated[float, Field(ge=0)] = Field(default=16.0, description="Length; 0: until Ctrl-C or SIGTERM.")
    seed: Annotated[int, Field(ge=0)] = 1
    arm: bool = Field(
        default=False,
        description="true: the simulated rig starts ARMED, without the loop check; false: `stickslip arm`.",
    )
    controller: ControllerConfig = ControllerConfig()
    bus: BusConfig = BusConfig()
    log: LogTable = LogTable()
    fault: list[FaultTable] = Field(default=[], description="Injected faults, a table `[[fault]]` each.")
    step: list[StepTable] = Field(default=[], description="Changes during the run, a table `[[step]]` each.")
    expect: list[ExpectTable] = Field(
        default=[], description="Expectations that `stickslip test` judges, a table `[[expect]]` each."
    )
    must_fail: list[MutantTable] = Field(
        default=[], description="Defects under which some expectation must fail, a table `[[must_fail]]` each."
    )

    @model_validator(mode="after")
    def _holds_its_times(self) -> Self:
        for table in [*self.fault, *(table for mutant in self.must_fail for table in mutant.fault)]:
            if 0.0 < self.duration_s <= table.from_s:
                line = f"fault: {table.in_words()}: from_s = {table.from_s:g}: must be before the end of the run"
                raise ValueError(f"{line}, duration_s = {self.duration_s:g}; begin it earlier, or run longer")
        names = [table.name for table in self.expect if table.name]
        if twice := [name for number, name in enumerate(names) if name in names[:number]]:
            raise ValueError(f"expect: name = {twice[0]}: is used twice; give each expectation a different name")
        for kind, tables in (("step", self.step), ("expect", self.expect)):
            for number, table in enumerate(tables):
                if late := table.after(self.duration_s or math.inf):
                    line = f"{kind}.{number}.{late}: must not be after the end of the run, duration_s = {self.duration_s:g}"
                    raise ValueError(f"{line}; set an earlier time, or run longer")
        configurations(self.controller, self.step)  # raises for a setting that no controller has
        return self

    def refuse_faults_of(self, absent: Collection[str]) -> None:
        """Raise ValueError for a fault of a channel that the rig does not have: it would change nothing."""
        for number, table in enumerate(self.fault):
            if missing := {table.target, table.other} & {*absent}:
                raise ValueError(f"fault.{number}: {min(missing)}: is absent in this rig; choose another target")

    @property
    def simulated_only(self) -> str:
        """The first of its tables that this rig does not carry out, as text; empty if it can run."""
        return ""


def refuse_for_processes(run: RunTables, lockstep: bool) -> None:
    """Raise Fault CONFIG for the faults and steps that a run of several processes cannot have.

    In lockstep these are faults of bus and processes; in real time faults of processes, as a scenario cannot end real processes.
    """
    if run.simulated_only:
        raise Fault("CONFIG", f"{run.name}: {run.simulated_only}; leave it out, or use a simulated rig")
    for number, table in enumerate(run.fault):
        if lockstep and table.needs_time:
            why = "needs a clock, which lockstep lacks; use --in-process, or real time"
        elif not lockstep and table.group == PROCESS:
            why = "a scenario cannot end real processes; use --in-process, or `stickslip fault` during the run"
        else:
            continue
        raise Fault("CONFIG", f"{run.name}: fault.{number}.target = {table.target}: {why}")
    if any(step.speed_mps is None for step in run.step):
        line = f"{run.name}: step: needs a run in one process, as only a change of speed is part of the rig"
        raise Fault("CONFIG", f"{line}; use `stickslip test`, or --in-process")


def processor() -> str:
    """Name of this processor: the last bit of a sine or an exponential depends on it."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), platform.machine())


def versions() -> dict[str, str]:
    """Versions of packages, Python, libc and processor: with equal ones a run in simulated time repeats bit for bit."""
    packages = {name: version(name) for name in ("stickslip", "numpy", "numba", "protobuf", "eclipse-zenoh", "mcap")}
    return packages | {
        "python": platform.python_version(),
        "libc": "-".join(platform.libc_ver()),
        "processor": processor(),
    }


def header_of(
    run: RunTables,
    rig: dict[str, Any],
    limits: VibrationLimits,
    name: str,
    role: str,
    lockstep: bool,
    more: dict[str, Any] | None = None,
) -> wire.Header:
    """The header of a process of a run: role, configuration and versions.

    Args:
        run: its tables.
        rig, limits, name: the rig as in the header, its limits of the vibration, its name.
        role, lockstep: of the process.
        more: further keys of the rig's configuration.

    """
    if role == "plant":
        configuration: dict[str, Any] = {
            "rig": rig,
            "seed": run.seed,
            "duration_s": run.duration_s,
            "lockstep": lockstep,
            "limits": limits._asdict(),
        } | (more or {})
    else:
        configuration = run.controller.model_dump(mode="json")
    return wire.Header(
        role=role,
        schema_version=SCHEMA_VERSION,
        configuration=json.dumps(configuration, sort_keys=True),
        versions=json.dumps(versions(), sort_keys=True),
        rig=name,
    )
