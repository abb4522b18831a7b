"""A made-up diagnosis and fakes of the diagnosing function, which are sent to worker processes."""

import os
import signal
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from bridge.faults import Fault
from bridge.log.finding import Finding
from diagnosis.evidence.folder import Evidence
from diagnosis.result import (
    Candidate,
    Cell,
    Curve,
    Diagnosis,
    Estimate,
    Experiment,
    Gap,
    LeftOut,
    Picture,
    RelationRow,
    Remainder,
    RigNumber,
    Share,
    Shrinkage,
    WrongNumber,
)
from tests.patience import PATIENCE_S

Progress = Callable[[str, float], None]
RIG = """
format = "evidence/1"
[rig]
drive = "spring"
mass_kg = 1.5
drive_stiffness_N_per_m = 11700.0
drive_damping_Ns_per_m = 0.0
contact_stiffness_N_per_m = 77.52e6
contact_damping_Ns_per_m = 2.15e4
viscous_damping_Ns_per_m = 0.0
coulomb_force_N = 14.49
static_force_N = 17.38
stribeck_velocity_mps = 0.0005
"""
MANIFEST = (
    RIG
    + """
[[run]]
file = "run-01.csv"
drive_velocity_mps = 0.0005
"""
)


def evidence_folder(at: Path) -> Path:
    """The smallest evidence that is read without a fault; its content differs by the folder's name."""
    at.mkdir(parents=True)
    t_s = np.arange(2000) / 2000
    force_N = 15 + 2 * np.sin(9 * t_s)
    lines = [f"{t:.6f},{force:.6f}" for t, force in zip(t_s, force_N, strict=True)]
    (at / "manifest.toml").write_text(f"{MANIFEST}# {at.name.encode(errors='replace').decode()}\n")
    (at / "run-01.csv").write_text("t_s,drive_force_N\n" + "\n".join(lines) + "\n")
    return at


def picture(kind: str = "cycle", points: int = 2000, seed: int = 1) -> Picture:
    """A saw tooth and its predictions, or a cloud of residuals."""
    random = np.random.default_rng(seed)
    t_s = np.linspace(0.0, 1.6, points)
    force_N = 11.5 + 3.6 * (t_s % 1.59) + random.normal(0, 0.03, points)
    if kind == "residual":
        cloud = Curve("measured - retuned", t_s * 5e-4, random.normal(0, 0.1, points), "points")
        return Picture("residual", "Residual of the drive force over position", "position [m]", "force [N]", (cloud,))
    curves = (
        Curve("measured", t_s, force_N, "measured"),
        Curve("as described", t_s, force_N - 0.5, "nominal"),
        Curve("retuned", t_s, force_N - 0.3, "retuned"),
        Curve("with drive-backlash", t_s, force_N - 0.02, "effect"),
    )
    return Picture("cycle", "Third cycle of run-04", "time in the cycle [s]", "drive force [N]", curves)


def diagnosis() -> Diagnosis:
    """An effect that was found, with everything that a diagnosis can hold."""
    signals = ("drive_force_N", "mass_accel_mps2")
    regimes = ("stick", "breakaway", "slip", "restick", "steady")
    bands = ((0.0, 20.0), (20.0, 200.0), (200.0, float("inf")))
    keys = [(s, r, b, run) for s in signals for r in regimes for b in bands for run in ("run-01", "run-02", "run-03")]
    weights = np.random.default_rng(3).pareto(1.0, len(keys))
    shares = weights / weights.sum()
    cells = [Cell(*key, float(share)) for key, share in zip(keys, shares, strict=True)]
    gap_m = Estimate(8.1e-5, (7.6e-5, 8.6e-5))
    others = ("force-sensor-lag", "frame-compliance", "none", "static-level", "coulomb-level", "piezo-sag")
    return Diagnosis(
        verdict="effect",
        effects=("drive-backlash",),
        summary=(
            "effect: drive-backlash, probability 95 %: gap 81 µm (90 %: 76 to 86), play in the drive: it moves a little without "
            "any force when the load changes sign",
            "sure       98 % that nothing else acts; other candidates drive-hardening 3 %, drive-damping 2 %; these runs cannot "
            "separate force-sensor-delay, drive-damping",
            "held out   run-04.parquet: the gap falls from 5.9 to 1.08 noise floors (perfect: 1), 98 % of it closed (90 %: 95 % "
            "to 100 %)",
            "else       46 mN remain in the spring relation over the extension, where noise is 12 mN: nothing in the library",
            "numbers    drive stiffness 11.01 kN/m (90 %: 10.95 to 11.07), described 11.7 kN/m (2.9 tolerances off)",
            "next       Reverse the drive at 0.1 mm/s with the mass at rest, three times. `--all` prints relations and shares, "
            "and 2 findings about the data.",
        ),
        candidates=(
            Candidate("drive-backlash", 0.95, "", {"gap_m": gap_m}),
            Candidate("drive-hardening", 0.03, "cubic", {"ratio": Estimate(0.21, (-0.02, 0.44))}),
            Candidate("drive-damping", 0.018, "", {"damping_Ns_per_m": Estimate(41.0, (float("nan"), float("nan")))}),
            *(Candidate(name, 0.002 / len(others)) for name in others),
        ),
        complete=0.98,
        not_distinguishable=(("force-sensor-delay", "drive-damping"),),
        where=tuple(sorted(cells, key=lambda cell: -cell.share)),
        gap=Gap(
            "root mean square over cycles of the difference of period, largest and smallest force and mean slip, each "
            "in units of its own scatter",
            ("run-04.parquet",),
            6.2,
            5.9,
            1.08,
            1.0,
            0.98,
            (0.95, 1.0),
            (
                Shrinkage("drive-backlash", 1.08, 0.98, (0.95, 1.0)),
                Shrinkage("drive-hardening", 3.1, 0.57, (0.41, 0.7)),
                Shrinkage("parameters alone", 5.9, 0.0, None),
            ),
        ),
        next_experiment=Experiment(
            "Reverse the drive at 0.1 mm/s with the mass at rest, three times.",
            "Play shows as a stretch without force at each reversal; hardening does not.",
            4.2,
        ),
        rig=(
            RigNumber("mass_kg", 1.5, 1.4968, 0.005),
            RigNumber("drive_stiffness_N_per_m", 11700.0, 11012.0, 0.02),
            RigNumber("contact_stiffness_N_per_m", 77.52e6, 77.52e6, 0.0),
            RigNumber("static_force_N", 17.38, 17.61, 0.03),
            RigNumber("stribeck_velocity_mps", 0.0005, 0.00052, 0.1),
            RigNumber("stribeck_tail", 0.0, -0.12, 0.4),
        ),
        findings=(
            Finding("missing", "run-01.parquet: base_accel_mps2", "missing: what the piezo delivers cannot be seen"),
            Finding("clipped", "run-02.parquet: drive_force_N", "12 samples at 20 N were left out", 12),
        ),
        pictures=(picture(), picture("residual")),
        compared_features=640,
        elapsed_s=21.0,
        shares=(
            Share("spring relation", "drive-backlash", 0.73, (0.61, 0.92), 0.12),
            Share("spring relation", "noise", 0.25, None, None),
            Share("spring relation", "unexplained", 0.02, (0.0, 0.05), None),
        ),
        remainder=Remainder(0.02, "spring relation", "over the extension", 0.046, 0.012, "N"),
        relations=(RelationRow("spring relation", "N", 0.8, 0.3, 0.05, 0.012, ("drive-backlash",)),),
        left_out=(LeftOut("base", "run-01.parquet has no base_accel_mps2"),),
        numbers=(WrongNumber("drive_stiffness_N_per_m", 11700.0, 11012.0, (10950.0, 11074.0), 2.94, 0.43),),
    )


def quick(evidence: Evidence, progress: Progress, jobs: int, budget_s: float | None = None) -> Diagnosis:
    """Return at once; the folder's name selects the result."""
    name = evidence.folder.name
    progress("the drive force is off by 6 noise floors", 0.1)
    if "refused" in name:
        raise Fault("BAD_EVIDENCE", "run-01.csv: too short")
    if "broken" in name:
        raise ZeroDivisionError("nothing to divide by")
    return diagnosis()._replace(elapsed_s=float(jobs), pictures=())


def dies(evidence: Evidence, progress: Progress, jobs: int, budget_s: float | None = None) -> Diagnosis:
    """Like `quick`, but whoever works on `killer`, or on `deadly` for the first time, is killed."""
    mark = evidence.folder / "killed"
    if evidence.folder.name == "killer" or (evidence.folder.name == "deadly" and not mark.exists()):
        mark.write_text(str(os.getpid()))
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(0.1)
    return quick(evidence, progress, jobs)


def marks(evidence: Evidence, progress: Progress, jobs: int, budget_s: float | None = None) -> Diagnosis:
    """Like `quick`, but leaves a line in the evidence's folder each time, and `slow` does not end."""
    with (evidence.folder / "done").open("a") as file:
        file.write("once\n")
    if "slow" in evidence.folder.name and not (evidence.folder / "fast").exists():
        time.sleep(PATIENCE_S)
    return quick(evidence, progress, jobs)


def endless(evidence: Evidence, progress: Progress, jobs: int, budget_s: float | None = None) -> Diagnosis:
    """Write the process id into the folder, and do not end."""
    (evidence.folder / "worker").write_text(str(os.getpid()))
    progress("this takes long", 0.1)
    time.sleep(PATIENCE_S)
    return quick(evidence, progress, jobs)
