"""A small evidence folder that is right in everything, for tests to put something wrong into."""

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from diagnosis.evidence.folder import Evidence
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
RATE_HZ, FREQUENCY_HZ = 20000.0, 2500.0  # where the runs are vibrated


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


def vibrated(pick_up_N: float, seconds: float = 2.0, frequency_Hz: float = FREQUENCY_HZ) -> Columns:
    """Stick-slip of a spring drive, vibrated in its second half, in the force of which there is that much of the vibration."""
    t_s = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    random = np.random.default_rng(1)
    on = t_s > 0.5 * seconds
    wave = np.where(on, np.sin(2.0 * np.pi * frequency_Hz * t_s + 0.7), 0.0)
    slips_N = 15.0 + 2.0 * (4.0 * t_s % 1.0)  # falls by 2 N within one sample: as much at 2.5 kHz as any slip can have
    return {
        "t_s": t_s,
        "drive_force_N": slips_N + pick_up_N * wave + random.normal(0.0, 0.02, t_s.size),
        "mass_accel_mps2": 1.0 * wave + random.normal(0.0, 0.1, t_s.size),
        "vibration_frequency_Hz": np.where(on, frequency_Hz, 0.0),
        "vibration_amplitude_m": np.where(on, 35e-9, 0.0),
    }


def folder(at: Path, data: Columns, manifest: str = MANIFEST, file: str = "run-01.parquet") -> Path:
    (at / "manifest.toml").write_text(manifest)
    pq.write_table(pa.table(data), at / file)
    return at


def kinds(evidence: Evidence) -> dict[str, str]:
    return {
        finding.kind: f"{finding.where}: {finding.text}" for finding in evidence.findings if finding.kind != "missing"
    }
