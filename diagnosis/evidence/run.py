"""An evidence in memory: the rig as described, the runs as float64 arrays in SI units, and the findings."""

from pathlib import Path
from typing import NamedTuple

from bridge.arrays import Floats
from bridge.log.finding import Finding
from diagnosis.evidence.foreign_vibration import ForeignVibration
from diagnosis.evidence.manifest import RigTable


class MeasuredRun(NamedTuple):
    """One measured run. Arrays are [samples], finite, SI units; `t_s` increases."""

    file: str
    t_s: Floats
    columns: dict[str, Floats]  # usable columns by standard name, without t_s
    # lowest and highest value that the sensor can show, by standard name; infinite where the run does not reach it
    clipped: dict[str, tuple[float, float]]
    drive_velocity_mps: float | None  # velocity in the manifest
    holdout: bool  # whether the run is held out: not fitted, only predicted
    foreign: tuple[ForeignVibration, ...] = ()  # vibrations that no effect of the library makes


class Evidence(NamedTuple):
    """All of an evidence folder; runs in the manifest's order."""

    folder: Path
    rig: RigTable
    runs: tuple[MeasuredRun, ...]
    findings: tuple[Finding, ...]
    assumed: tuple[str, ...] = ()  # rig numbers that the manifest leaves out
