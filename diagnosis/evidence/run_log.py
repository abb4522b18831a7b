"""A run log of this project as evidence: its sensor blocks, and the commands in force during each block."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from bridge.arrays import Floats
from bridge.faults import Fault
from bridge.log.damage import damage_findings
from bridge.log.finding import Finding
from bridge.log.logfile import RunData, block_period_ns, read_run, sample_times_s
from bridge.log.metadata import is_number, value_at
from bridge.tables.export import CHANNELS
from diagnosis.evidence.manifest import PLACES, RigTable
from diagnosis.evidence.manifest_keys import Columns


class LoggedRun(NamedTuple):
    """A run log as evidence."""

    columns: Columns  # standard columns, [samples] each in SI units
    findings: list[Finding]  # one for each damage
    rig: dict[str, float]  # numbers of [rig] that the header of the rig describes, without its effects


def columns_of_log(path: Path) -> LoggedRun:
    """The columns and the described rig of a run log. Raises Fault BAD_LOG, BAD_MESSAGE."""
    run = read_run(path)
    sensors = run.sensors
    if not len(sensors):
        raise Fault("BAD_LOG", f"{path.name}: holds no sensor block; give another log")
    columns: Columns = {"t_s": sample_times_s(sensors, block_period_ns(sensors)).ravel()}
    # an imported log has zeros for a channel that its source lacked, and names the channel in its header
    absent = run.headers.get("import", {}).get("missing", "")
    columns |= {name: sensors[name].astype(np.float64).ravel() for name in CHANNELS if name not in absent}
    if len(run.command):
        frequency_Hz, amplitude_m = _commanded(run)
        samples = sensors["drive_force_N"].shape[1]
        columns["vibration_frequency_Hz"] = np.repeat(frequency_Hz, samples)
        columns["vibration_amplitude_m"] = np.repeat(amplitude_m, samples)
    return LoggedRun(columns, damage_findings(run.damage, path), _described(run))


def _described(run: RunData) -> dict[str, float]:
    rig = run.configuration("plant").get("rig") if "configuration" in run.headers.get("plant", {}) else None
    numbers = {name: value_at(rig, f"{part}.{key}") for name, (part, key) in PLACES.items()}
    return {name: float(value) for name, value in numbers.items() if name in RigTable.model_fields and is_number(value)}


def _commanded(run: RunData) -> tuple[Floats, Floats]:
    """Frequency and amplitude in force during each block, [blocks]; 0 before the first command."""
    block = run.sensors["sequence"]
    # The applied commands that the rig reports have priority; else the command that answers the block before, as in lockstep.
    answered = np.where(block > 0, block - np.uint64(1), np.uint64(2**64 - 1))
    if len(run.applied):
        order = np.argsort(run.applied["sequence"], kind="stable")
        numbers = run.applied["sequence"][order]
        at = np.minimum(np.searchsorted(numbers, block), len(numbers) - 1)
        answered = np.where(numbers[at] == block, run.applied["command_block"][order][at], answered)
    order = np.argsort(run.command["block"], kind="stable")
    blocks = run.command["block"][order]
    at = np.minimum(np.searchsorted(blocks, answered), len(blocks) - 1)
    known = blocks[at] == answered
    commands = run.command[order][at]
    return np.where(known, commands["frequency_Hz"], 0.0), np.where(known, commands["amplitude_m"], 0.0)
