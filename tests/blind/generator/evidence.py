"""One evidence folder: manifest.toml and a parquet file per run, of the same shape for every rig."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from tests.blind.generator.effect import Signals
from tests.blind.generator.rig import DESCRIBED, TOLERANCE
from tests.blind.generator.runs import Plan

COLUMNS = (
    "t_s",
    "drive_force_N",
    "mass_accel_mps2",
    "base_accel_mps2",
    "mass_position_m",
    "drive_position_m",
    "vibration_frequency_Hz",
    "vibration_amplitude_m",
)


def file_name(number: int) -> str:
    """Name of the file of run `number`, counted from 0."""
    return f"run-{number + 1:02d}.parquet"


def manifest(plans: tuple[Plan, ...]) -> str:
    """The manifest, with the rig as its owner knows it: the same text for every case of a protocol."""
    lines = ['format = "evidence/1"', "", "[rig]", 'drive = "spring"']
    lines += [f"{name} = {value!r}" for name, value in DESCRIBED.items()]
    lines += ["", "[rig.tolerance]"]
    lines += [f"{name} = {value!r}" for name, value in TOLERANCE.items()]
    for number, plan in enumerate(plans):
        lines += ["", "[[run]]", f'file = "{file_name(number)}"']
        if plan.constant_velocity_mps is not None:
            lines.append(f"drive_velocity_mps = {plan.constant_velocity_mps!r}")
        lines.append(f"holdout = {str(plan.holdout).lower()}")
    return "\n".join(lines) + "\n"


def write_run(path: Path, signals: Signals, leave_out: tuple[str, ...]) -> None:
    """Write one run: time in float64, as float32 resolves 10 s to 1 us only; all other columns in float32."""
    columns = [name for name in COLUMNS if name not in leave_out]
    arrays = [pa.array(signals[name].astype(np.float64 if name == "t_s" else np.float32)) for name in columns]
    pq.write_table(pa.table(arrays, names=columns), path, compression="zstd", compression_level=1)
