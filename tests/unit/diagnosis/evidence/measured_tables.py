"""A measured table in every format, and a map of its columns."""

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq
import scipy.io
from nptdms import ChannelObject, TdmsWriter

MAP = """
[channels]
t_s = { column = "time", scale = 1e-3 }
drive_force_N = { column = "F", scale = 0.5, offset = 1.0 }
mass_accel_mps2 = { column = "acc", scale = 9.80665 }
[rig]
drive = "spring"
mass_kg = 1.5
drive_stiffness_N_per_m = 11700.0
coulomb_force_N = 14.49
static_force_N = 17.38
stribeck_velocity_mps = 0.0005
[rig.tolerance]
mass_kg = 0.005
[run]
drive_velocity_mps = 0.0005
"""
ROWS = 4010
CSV = "Zeit;F\n" + "".join(f"{i * 0.5:.1f};{9.5 + 0.01 * (i % 7):.2f}\n" for i in range(4000)).replace(".", ",")
SOURCE = '[source]\ndelimiter = ";"\ndecimal = ","\n'
GERMAN = MAP.replace('column = "time"', 'column = "Zeit"').replace(
    'mass_accel_mps2 = { column = "acc", scale = 9.80665 }\n', ""
)


def raw() -> dict[str, Any]:
    random = np.random.default_rng(3)
    time_ms = np.arange(ROWS) * 0.5
    force = 28 + 4 * np.sin(time_ms * 9e-3) + random.normal(0, 0.02, ROWS)
    return {"time": time_ms, "F": force, "acc": random.normal(0, 0.1, ROWS), "note": np.zeros(ROWS)}


def write_raw(path: Path, data: dict[str, Any]) -> None:
    if path.suffix == ".csv":
        pyarrow.csv.write_csv(pa.table(data), path)
    elif path.suffix == ".parquet":
        pq.write_table(pa.table(data), path)
    elif path.suffix == ".mat":
        scipy.io.savemat(path, data | {"gain": 35.15})
    else:
        with TdmsWriter(path) as writer:
            writer.write_segment(
                [ChannelObject("DAQ", name, values, {"wf_increment": 0.0005}) for name, values in data.items()]
            )


def setup(at: Path, suffix: str, text: str = MAP) -> tuple[Path, Path]:
    source, channel_map = at / f"measured{suffix}", at / "map.toml"
    write_raw(source, raw())
    channel_map.write_text(text)
    return source, channel_map
