"""Which samples and columns of a run can be used, and what is wrong with the others."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from bridge.faults import Fault
from diagnosis.findings import Finding
from diagnosis.manifest import RigTable, RunTable
from diagnosis.signal_checks import look

Floats = npt.NDArray[np.float64]
Columns = dict[str, Floats]
Clipped = dict[str, npt.NDArray[np.bool_]]
Note = Callable[[str, str, str], None]  # kind, column, text

_FEWEST_ROWS = 16
# more bad rows than this, and the file is not what it says it is
_LARGEST_BAD_SHARE = 0.1
_SENSORS = ("drive_force_N", "mass_accel_mps2", "base_accel_mps2", "mass_position_m")
_GAP_STEPS = 10.0  # times the usual step
_VELOCITY_TOLERANCE = 0.1  # of the stated drive velocity against the drive position's slope
# Largest values that can be right; a factor of 1000, as between mm and m, shows in at least one of them on a bench rig.
_LARGEST = {
    "mass_accel_mps2": 1e5,
    "base_accel_mps2": 1e5,
    "mass_position_m": 10.0,  # of travel
    "drive_position_m": 10.0,
    "vibration_frequency_Hz": 1e6,
    "vibration_amplitude_m": 1e-3,  # piezo stacks move by a tenth of a millimetre
}
# a force sensor that never shows 1/300 of the friction, or shows 300 times that, measures in another unit
_FORCE_FACTOR = 300.0


def checked(columns: Columns, rig: RigTable, table: RunTable) -> tuple[Columns, Clipped, list[Finding]]:
    """Usable columns, where they are clipped, and the findings. Raises Fault BAD_EVIDENCE when no time is left."""
    findings: list[Finding] = []
    file = table.file

    def note(kind: str, name: str, text: str, times: int = 1) -> None:
        findings.append(Finding(kind, f"{file}: {name}", text, times))

    _check_shape(columns, file)
    usable = dict(columns)
    for name in list(usable):
        bad = ~np.isfinite(usable[name])
        if name != "t_s" and bad.mean() > 0.5:
            note(
                "not-finite", name, f"{bad.sum()} of {len(bad)} samples are no finite number; not used", int(bad.sum())
            )
            del usable[name]
    usable = _good_rows(usable, file, findings)
    t_s = usable["t_s"]
    step_s = np.diff(t_s)
    usual_s = float(np.median(step_s))
    gaps = np.flatnonzero(step_s > _GAP_STEPS * usual_s)
    if len(gaps):
        at = gaps[0]
        text = f"{len(gaps)} gaps in time, first at {t_s[at]:.6g} s: {step_s[at]:.3g} s without a sample"
        note("time-gap", "t_s", text, len(gaps))
    if usual_s > 0.05:
        note("units", "t_s", f"a sample every {usual_s:g} s: too slow to see a slip; is the column in ms?")
    clipped: Clipped = {}
    for name in [name for name in usable if name != "t_s"]:
        values = usable[name]
        seen = look(values, dwells=name.endswith("_m"))
        wrong = _wrong_unit(name, values, rig)
        if wrong:
            note("units", name, f"{wrong}; not used; set channels.{name}.scale")
            del usable[name]
        elif seen.constant and not name.startswith("vibration"):
            used = "" if name == "drive_position_m" else "; not used"
            note("constant", name, f"is {seen.lowest:g} in every row{used}", seen.samples)
            if name in _SENSORS:
                del usable[name]
        elif (seen.clipped_high or seen.clipped_low) and name in (*_SENSORS, "drive_position_m"):
            mask = np.zeros(len(values), np.bool_)
            for times, limit in ((seen.clipped_high, seen.highest), (seen.clipped_low, seen.lowest)):
                if times:
                    mask |= values == limit
                    row = int(np.flatnonzero(values == limit)[0]) + 1
                    note("clipped", name, f"{times} samples at {limit:g}, first row {row}; these are not fitted", times)
            clipped[name] = mask
    _compare_velocity(usable, table, note)
    return usable, clipped, findings


def _check_shape(columns: Columns, file: str) -> None:
    if "t_s" not in columns:
        has = ", ".join(columns) or "no standard column"
        raise Fault("BAD_EVIDENCE", f"{file}: t_s: missing; the file has {has}; add the column or map it in [channels]")
    rows = len(columns["t_s"])
    if rows < _FEWEST_ROWS:
        line = f"{file}: t_s: {rows} rows: must have {_FEWEST_ROWS} at least; give a longer run"
        raise Fault("BAD_EVIDENCE", line)
    for name, values in columns.items():
        if len(values) != rows:
            line = (
                f"{file}: {name}: {len(values)} rows: must have {rows}, as t_s; every column needs one value a sample"
            )
            raise Fault("BAD_EVIDENCE", line)


def _good_rows(columns: Columns, file: str, findings: list[Finding]) -> Columns:
    """Only rows that are finite throughout and later than every row before."""
    t_s = columns["t_s"]
    rows = len(t_s)
    good = np.ones(rows, np.bool_)
    for name, values in columns.items():
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            text = f"{len(bad)} samples are no finite number, first row {bad[0] + 1}; these rows are not used"
            findings.append(Finding("not-finite", f"{file}: {name}", text, len(bad)))
            good[bad] = False
    latest_s = np.maximum.accumulate(np.where(np.isfinite(t_s), t_s, -np.inf))
    repeated = np.zeros(rows, np.bool_)
    repeated[1:] = np.isfinite(t_s[1:]) & (t_s[1:] <= latest_s[:-1])
    back = np.flatnonzero(repeated)
    if len(back):
        at = int(back[0])
        text = (
            f"{len(back)} rows are not later than the one before, first row {at + 1}: {t_s[at]:.9g} s after "
            f"{latest_s[at - 1]:.9g} s; these rows are not used"
        )
        findings.append(Finding("time", f"{file}: t_s", text, len(back)))
        good[back] = False
    lost = rows - int(good.sum())
    if lost > _LARGEST_BAD_SHARE * rows or int(good.sum()) < _FEWEST_ROWS:
        worst = findings[-1]
        line = (
            f"{worst.where}: {worst.text}: {lost} of {rows} rows cannot be used: must be below "
            f"{100 * _LARGEST_BAD_SHARE:g} %; repair the file, or cut it where the trouble begins"
        )
        raise Fault("BAD_EVIDENCE", line)
    return {name: values[good] for name, values in columns.items()} if lost else columns


def _wrong_unit(name: str, values: Floats, rig: RigTable) -> str:
    """Why the unit of a column cannot be right; empty when it can."""
    size = float(np.abs(values).max())
    if name == "drive_force_N":
        static_N = rig.static_force_N
        factor = size / static_N
        if factor > _FORCE_FACTOR or 0.0 < factor < 1.0 / _FORCE_FACTOR:
            return f"largest value {size:g} N, {factor:.2g} times rig.static_force_N = {static_N:g}: the unit cannot be right"
        return ""
    if name.endswith("position_m"):
        size = float(np.ptp(values))
    if name in _LARGEST and size > _LARGEST[name]:
        return f"reaches {size:g}: must be below {_LARGEST[name]:g}, the unit cannot be right"
    return ""


def _compare_velocity(columns: Columns, table: RunTable, note: Note) -> None:
    stated_mps = table.drive_velocity_mps
    if stated_mps is None or "drive_position_m" not in columns or stated_mps == 0.0:
        return
    t_s, position_m = columns["t_s"], columns["drive_position_m"]
    measured_mps = float(position_m[-1] - position_m[0]) / float(t_s[-1] - t_s[0])
    if abs(measured_mps - stated_mps) > _VELOCITY_TOLERANCE * abs(stated_mps):
        text = f"moves at {measured_mps:.4g} m/s on average, drive_velocity_mps says {stated_mps:.4g}: check units and time"
        note("units", "drive_position_m", text)
