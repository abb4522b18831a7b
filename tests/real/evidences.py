"""Evidence folders from the public logs next to the repository. The rig tables hold the publishers' numbers.

Other numbers are read off the record with a ruler, or taken from the literature on such contacts, and get a wide
tolerance. No number here comes from a fit of this project.
"""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq
import scipy.io

DATA = Path(__file__).parents[3] / "shared" / "data"
SLIDER, AXIS = DATA / "ens_stickslip", DATA / "emps"
MISSING = f"needs the measured logs in ../shared/data ({DATA})"

_MASS_KG = 0.0307  # of the slider, published with the logs
_WEIGHT_N = _MASS_KG * 9.81


Floats = npt.NDArray[np.float64]
Sensor = Callable[[Floats, Floats], Floats]


def faithful(_t_s: Floats, force_N: Floats) -> Floats:
    """Signal of a sensor without fault for a force [N] over time [s]; tests/blind/real_logs.py has others."""
    return force_N


class Cut(NamedTuple):
    """A stretch of a slider log as one run, by time since the log's first sample."""

    log: str
    drive_velocity_mps: float  # in the log's name
    first_s: float
    last_s: float
    holdout: bool = False

    @property
    def file(self) -> str:
        """Name of the run's file."""
        return f"{self.log}-{self.first_s:g}-to-{self.last_s:g}s.parquet"


class Levels(NamedTuple):
    """Friction over weight, with a ruler on the whole log: mean of the peaks, and of peaks and troughs.

    An undamped slider on a spring falls as far below the sliding friction as it starts above it at breakaway.
    """

    static: float
    coulomb: float


_SLIDER_MANIFEST = """
format = "evidence/1"
[rig]
drive = "spring"
mass_kg = {mass_kg}
drive_stiffness_N_per_m = {stiffness_N_per_m}  # in the log's name
drive_damping_Ns_per_m = 0.0
contact_stiffness_N_per_m = 1e5  # 0.1 N over 1 um, the way that renews paper contacts (Heslot 1994)
contact_damping_Ns_per_m = 111.0  # 2 sqrt(k m): critically damped
viscous_damping_Ns_per_m = 0.0
coulomb_force_N = {coulomb_N:.5f}
static_force_N = {static_N:.5f}
stribeck_velocity_mps = 0.0001  # it sticks and slips at 42 um/s: friction has begun to fall there
[rig.tolerance]
mass_kg = 0.005
drive_stiffness_N_per_m = 0.03
contact_stiffness_N_per_m = 0.5
contact_damping_Ns_per_m = 0.5
coulomb_force_N = {level_tolerance}
static_force_N = {level_tolerance}
stribeck_velocity_mps = 0.5
[channels]
t_s = {{ column = "t" }}
drive_force_N = {{ column = "Fnorm", scale = {weight_N:.6f} }}  # F / (m g)
"""


def slider(
    folder: Path,
    stiffness_N_per_m: float,
    levels: Levels,
    cuts: tuple[Cut, ...],
    sensor: Sensor = faithful,
    level_tolerance: float = 0.1,
) -> None:
    """Write an evidence of the spring-dragged slider. The drive is even: its position is V t."""
    folder.mkdir(parents=True, exist_ok=True)
    manifest = _SLIDER_MANIFEST.format(
        mass_kg=_MASS_KG,
        stiffness_N_per_m=stiffness_N_per_m,
        coulomb_N=levels.coulomb * _WEIGHT_N,
        static_N=levels.static * _WEIGHT_N,
        weight_N=_WEIGHT_N,
        level_tolerance=level_tolerance,
    )
    for cut in cuts:
        log = scipy.io.loadmat(SLIDER / f"{cut.log}.mat")
        t_s = log["t"].ravel()
        force = sensor(t_s, log["Fnorm"].ravel() * _WEIGHT_N) / _WEIGHT_N
        in_cut = (t_s - t_s[0] >= cut.first_s) & (t_s - t_s[0] < cut.last_s)
        table = {"t": t_s[in_cut], "Fnorm": force[in_cut], "drive_position_m": cut.drive_velocity_mps * t_s[in_cut]}
        pq.write_table(pa.table(table), folder / cut.file)
        manifest += f'[[run]]\nfile = "{cut.file}"\ndrive_velocity_mps = {cut.drive_velocity_mps}\n'
        manifest += "holdout = true\n" if cut.holdout else ""
    (folder / "manifest.toml").write_text(manifest, encoding="utf-8")


_N_PER_V = 35.15
# friction, mass and viscous damping as published; the other numbers as for a ball screw with seals
AXIS_MANIFEST = """
format = "evidence/1"
[rig]
drive = "force"
mass_kg = 95.1
contact_stiffness_N_per_m = 2e6
contact_damping_Ns_per_m = 2.76e4
viscous_damping_Ns_per_m = 203.5
coulomb_force_N = 20.4
static_force_N = 22.4
stribeck_velocity_mps = 0.003
[rig.tolerance]
mass_kg = 0.03
contact_stiffness_N_per_m = 0.2
contact_damping_Ns_per_m = 0.2
viscous_damping_Ns_per_m = 0.1
coulomb_force_N = 0.1
static_force_N = 0.1
stribeck_velocity_mps = 0.2
[channels]
t_s = { column = "t" }
drive_force_N = { column = "vir", scale = 35.15 }
mass_position_m = { column = "qm" }
[[run]]
file = "DATA_EMPS.mat"
[[run]]
file = "DATA_EMPS_PULSES.mat"
holdout = true
"""


def axis(folder: Path, sensor: Sensor = faithful) -> None:
    """Write the evidence of the motor axis; the file that was published for validation is held out."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("DATA_EMPS.mat", "DATA_EMPS_PULSES.mat"):
        log = scipy.io.loadmat(AXIS / name)
        t_s, signal_V = log["t"].ravel(), log["vir"].ravel()
        shown_V = sensor(t_s, _N_PER_V * signal_V) / _N_PER_V
        scipy.io.savemat(folder / name, {"t": t_s, "vir": shown_V, "qm": log["qm"].ravel()})
        with (folder / name).open("r+b") as file:
            file.write(b"MATLAB 5.0 MAT-file".ljust(116))  # in place of the time of writing: the same is the same again
    (folder / "manifest.toml").write_text(AXIS_MANIFEST, encoding="utf-8")


def _fast(folder: Path) -> None:
    cuts = (Cut("k168Nm_v1100", 1.1e-3, 0.0, 9.0), Cut("k168Nm_v1100", 1.1e-3, 9.0, 14.4, holdout=True))
    slider(folder, 168.0, Levels(0.362, 0.332), cuts)


def _slow(folder: Path) -> None:
    # one wave of friction takes 90 s at this speed
    cuts = (Cut("k168Nm_v42", 4.2e-5, 0.0, 100.0), Cut("k168Nm_v42", 4.2e-5, 100.0, 160.0, holdout=True))
    slider(folder, 168.0, Levels(0.323, 0.303), cuts)


def _speeds(folder: Path) -> None:
    cuts = (
        Cut("k168Nm_v42", 4.2e-5, 0.0, 60.0),
        Cut("k168Nm_v1100", 1.1e-3, 0.0, 9.0),
        Cut("k168Nm_v4300", 4.3e-3, 0.0, 3.8, holdout=True),
    )
    slider(folder, 168.0, Levels(0.35, 0.32), cuts)  # between the levels of the two fitted logs


def _stiff(folder: Path) -> None:
    cuts = (Cut("k1002Nm_v1100", 1.1e-3, 0.0, 9.0), Cut("k1002Nm_v1100", 1.1e-3, 9.0, 14.4, holdout=True))
    slider(folder, 1002.0, Levels(0.364, 0.333), cuts)


def _noisy(folder: Path) -> None:
    cuts = (Cut("k2254Nm_v42", 4.2e-5, 0.0, 20.0), Cut("k2254Nm_v42", 4.2e-5, 20.0, 40.0, holdout=True))
    # no peak can be seen; the middle of the record is sliding friction, and paper on paper sticks by some 10 % more
    slider(folder, 2254.0, Levels(0.40, 0.367), cuts)


EVIDENCES: dict[str, Callable[[Path], None]] = {
    "slider-fast": _fast,
    "slider-slow": _slow,
    "slider-speeds": _speeds,
    "slider-stiff": _stiff,
    "slider-noisy": _noisy,
    "axis": axis,
}
