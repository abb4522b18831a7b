"""An evidence folder read into memory: the rig as described, the runs as float64 arrays in SI units, and every doubt.

What cannot be used is left out and reported as a finding; where nothing usable remains, a Fault says so.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.faults import Fault
from bridge.tables import read_table
from diagnosis.evidence_checks import Columns, checked
from diagnosis.findings import Finding
from diagnosis.log_evidence import columns_of_log
from diagnosis.manifest import STANDARD, ChannelMap, Manifest, RigTable, RunTable, read_manifest

Floats = npt.NDArray[np.float64]
# what each column tells that no other one does
_COST = {
    "drive_force_N": "slips are seen in the acceleration only, and no force level or drive stiffness can be judged",
    "mass_accel_mps2": "mass, normal-load fluctuation and the fast part of a slip are judged from the force alone",
    "base_accel_mps2": "what the piezo really delivers, and a base that gives way, cannot be seen",
    "mass_position_m": "position-dependent friction and frame compliance are judged from the drive position only",
    "drive_position_m": "the drive counts as perfectly even: no speed ripple can be seen",
}


class Run(NamedTuple):
    """One run. Every column has the length of `t_s`, which increases, and is finite."""

    file: str
    t_s: Floats
    columns: dict[str, Floats]  # by standard name, without t_s; only the usable ones
    clipped: dict[str, npt.NDArray[np.bool_]]  # by standard name: samples at a limit that the sensor could not pass
    drive_velocity_mps: float | None
    holdout: bool


class Evidence(NamedTuple):
    """A whole folder."""

    folder: Path
    rig: RigTable
    runs: tuple[Run, ...]
    findings: tuple[Finding, ...]
    chosen_holdout: str | None  # file of the run that was chosen because the manifest marks none


def load_evidence(folder: Path) -> Evidence:
    """Read and check an evidence folder. Raises Fault BAD_EVIDENCE: file, key or column, row, expectation, remedy."""
    manifest = read_manifest(folder)
    runs: list[Run] = []
    findings: list[Finding] = []
    for table in manifest.run:
        run, found = _run(folder, manifest, table)
        runs.append(run)
        findings += found
    chosen = None
    if len(runs) > 1 and not any(run.holdout for run in runs):
        # the last one, so that adding nothing but a run never changes an earlier choice silently
        chosen = runs[-1].file
        runs[-1] = runs[-1]._replace(holdout=True)
        text = "no run is marked holdout: this one is kept for judging; mark one to choose for yourself"
        findings.append(Finding("holdout", chosen, text))
    return Evidence(folder, manifest.rig, tuple(runs), tuple(findings), chosen)


def _run(folder: Path, manifest: Manifest, table: RunTable) -> tuple[Run, list[Finding]]:
    columns = read_columns(folder / table.file, manifest.channels)
    return examine(columns, manifest.rig, table)


def examine(columns: Columns, rig: RigTable, table: RunTable) -> tuple[Run, list[Finding]]:
    """A run out of its raw columns, with what was found on the way. Raises Fault BAD_EVIDENCE."""
    usable, clipped, findings = checked(columns, rig, table)
    reasons = "; ".join(f"{finding.where}: {finding.text}" for finding in findings if finding.kind != "clipped")

    def refuse(rule: str) -> Fault:
        return Fault("BAD_EVIDENCE", f"{table.file}: {rule}" + (f" ({reasons})" if reasons else ""))

    has = ", ".join(sorted(usable)) or "nothing"
    if rig.drive == "force" and "drive_force_N" not in usable:
        raise refuse(f'drive_force_N: missing; with drive = "force" it is the input; it has {has}')
    if not {"drive_force_N", "mass_accel_mps2"} & usable.keys():
        raise refuse(f"has {has}: must have drive_force_N or mass_accel_mps2; map one in [channels]")
    if rig.drive == "force" and not {"mass_accel_mps2", "mass_position_m"} & usable.keys():
        raise refuse(f'has {has}: with drive = "force" must have mass_accel_mps2 or mass_position_m; map one')
    if rig.drive == "spring" and "drive_position_m" not in usable and table.drive_velocity_mps is None:
        raise refuse("drive_velocity_mps: missing in [[run]]; without the column drive_position_m it is needed")
    wanted = _COST if rig.drive == "spring" else {key: _COST[key] for key in ("mass_accel_mps2", "mass_position_m")}
    findings += [
        Finding("missing", f"{table.file}: {name}", f"not there: {cost}")
        for name, cost in wanted.items()
        if name not in usable
    ]
    t_s = usable.pop("t_s")
    return Run(table.file, t_s, usable, clipped, table.drive_velocity_mps, table.holdout), findings


def read_columns(path: Path, channels: dict[str, ChannelMap]) -> Columns:
    """The standard columns of a data file, mapped and in SI units, unchecked. Raises Fault BAD_EVIDENCE."""
    try:
        if path.suffix == ".mcap":
            return columns_of_log(path)
        table = read_table(path)
        found: Columns = {}
        for name in STANDARD:
            if name in channels:
                source = channels[name]
                found[name] = table.column(source.column) * source.scale + source.offset
            elif name in table.columns:
                found[name] = table.column(name)
    except Fault as fault:
        line = fault.line if path.name in fault.line else f"{path.name}: {fault.line}"
        raise Fault("BAD_EVIDENCE", line) from None
    return found
