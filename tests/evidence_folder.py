"""A small evidence folder that is right in everything, for tests to put something wrong into."""

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from diagnosis.evidence import Evidence
from tests.made_up import RIG

MANIFEST = (
    RIG
    + """
[rig.tolerance]
mass_kg = 0.005
drive_stiffness_N_per_m = 0.02
coulomb_force_N = 0.03
static_force_N = 0.03
stribeck_velocity_mps = 0.1
[[run]]
file = "run-01.parquet"
drive_velocity_mps = 0.0005
"""
)
Columns = dict[str, Any]


def columns() -> Columns:
    t_s = np.arange(4000) / 2000
    random = np.random.default_rng(1)
    force_N = 15 + 2 * np.sin(9 * t_s) + random.normal(0, 0.02, t_s.size)
    return {
        "t_s": t_s,
        "drive_force_N": force_N,
        "mass_accel_mps2": random.normal(0, 1.0, t_s.size),
        "drive_position_m": 0.0005 * t_s,
    }


def folder(at: Path, data: Columns, manifest: str = MANIFEST, file: str = "run-01.parquet") -> Path:
    (at / "manifest.toml").write_text(manifest)
    pq.write_table(pa.table(data), at / file)
    return at


def kinds(evidence: Evidence) -> dict[str, str]:
    return {
        finding.kind: f"{finding.where}: {finding.text}" for finding in evidence.findings if finding.kind != "missing"
    }
