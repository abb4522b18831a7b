"""Which samples and columns of a run can be used, and a finding for each unusable column."""

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from bridge.arrays import Floats
from bridge.faults import Fault
from bridge.log.check.signal_range import look
from bridge.log.finding import Finding
from bridge.tables.one_clock import gaps_of
from bridge.units import counted, percent
from bridge.wire.channels import CHANNELS
from diagnosis.evidence.manifest import RigTable, RunTable
from diagnosis.evidence.manifest_keys import FURTHER, STANDARD, VIBRATION, Columns

Clipped = dict[str, tuple[float, float]]
Note = Callable[[str, str, str], None]  # kind, column, text

# Kinds of findings that a user has to correct before the answer is worth reading: the headline of a diagnosis names them.
WRONG_UNIT, WRONG_SIGN = "wrong-unit", "sign"

# Limits of this file: beyond a limit a finding is made or the run is refused. A stricter limit refuses good files; with a looser
# limit a damaged file or a wrong unit counts as a gap of the rig.
_FEWEST_ROWS = 16
_LARGEST_BAD_SHARE = 0.1  # largest share of unusable rows; with more, the file is refused
_LARGEST_WILD_SHARE = 1e-3  # largest share of impossible values from a loose contact or a number that means "no value"
# Longest gap, and largest share of gaps in a run. In a longer gap the slips of rig and model drift apart.
_LONGEST_GAP_S, _LARGEST_GAP_SHARE = 1.0, 0.1
_VELOCITY_TOLERANCE = 0.1  # largest relative difference of the stated drive velocity and the drive position's slope
# Factor between the two (or another sign) from which the stated velocity belongs to another run
_OTHER_RUN_FACTOR = 3.0
_MOST_TRAVEL = 10.0  # largest travel of a position, over the drive's way; mm in place of m are a factor of 1000
_LEAST_TRAVEL = 0.002  # least travel of a drive, over its way to the first slip; the noise of a drive at rest is less
_FASTEST = 300.0  # largest speed of a drive, over the Stribeck velocity; mm/s in place of m/s are a factor of 1000
_OTHER_UNIT_FACTOR = 5.0  # factor from which a unit is wrong: an acceleration in g is off by 9.8, N/mm by 1000
_STRIDE_S = 0.1  # time between the positions whose distances add up to a way [s]; with a shorter stride noise adds up
_FEWEST_IN_A_SLIP = 3.0  # fewest samples in a slip
_SHORTEST_S = 1.0  # shortest run
_QUICKEST_S = 2e-6  # shortest sample time (500 kHz); a shorter one means that time is not in seconds
_SLOWEST_S = 0.05  # longest sample time with a force drive
_MOST_TURNS = 1e4  # a rotary rig may travel this factor further: the angle of a spindle adds up
# A force column has a wrong unit if its largest value is below 1/300 of the static friction or above 300 times.
_FORCE_FACTOR = 300.0
_BIN_S = 1e-3
# Standard deviation of the smoothing. Too small: noise; too large: slips are lost. A slip on the paper's spring takes about
# 40 ms, and 4 ms leave most of its acceleration.
_SMOOTH_BINS = 4.0
_BESIDE_BINS = 61  # bins left out around a vibration: its remainder in a mean over 1 ms is as large as a slip
_FEWEST_BINS = 500  # fewest bins of a run; a stiffness from fewer bins is noise
# Smallest correlation of force and acceleration for which a stiffness is returned. Too small: runs without slips, noise against
# noise, give a false stiffness. Too large: wrong signs and units stay unseen. Counted: docs/method/diagnosis.md.
_LEAST_CORRELATION = 0.9


def checked(columns: Columns, rig: RigTable, table: RunTable) -> tuple[Columns, Clipped, list[Finding]]:
    """Usable columns of a run [samples], the limits of clipped columns in their unit, and the findings.

    Raises Fault BAD_EVIDENCE when the run cannot be used: its time, length, rate, gaps, or a commanded column are wrong.
    """
    findings: list[Finding] = []
    file = table.name

    def note(kind: str, name: str, text: str, times: int = 1) -> None:
        findings.append(Finding(kind, f"{file}: {name}", text, times))

    _check_shape(columns, file)
    usable = dict(columns)
    for name in list(usable):
        bad = ~np.isfinite(usable[name])
        if name in VIBRATION and bad.any():  # the model would run without this vibration
            where = f"{bad.sum()} of {counted(len(bad), 'row')}, first row {np.argmax(bad) + 1}"
            raise Fault(
                "BAD_EVIDENCE",
                f"{file}: {name}: no finite number in {where}: must be one in every row; write 0 where the vibration is off",
            )
        if name != "t_s" and bad.mean() > 0.5:
            text = f"no finite number in {bad.sum()} of {counted(len(bad), 'row')}; not used"
            note("not-finite", name, text, int(bad.sum()))
            del usable[name]
    usable, rows = _good_rows(usable, rig, file, findings)
    t_s = usable["t_s"]
    step_s = np.diff(t_s)
    usual_s = float(np.median(step_s))
    _check_length(float(t_s[-1] - t_s[0]) + usual_s, usual_s, file)
    gaps, text = gaps_of(t_s)
    if len(gaps):
        longest_s, share = float(step_s.max()), float(step_s[gaps].sum() / (t_s[-1] - t_s[0]))
        if longest_s > _LONGEST_GAP_S or share > _LARGEST_GAP_SHARE:
            line = (
                f"{file}: t_s: {text}, {percent(share)} of the run in all: must be "
                f"{_LONGEST_GAP_S:g} s and {100 * _LARGEST_GAP_SHARE:g} % at most; split the file there into several runs"
            )
            raise Fault("BAD_EVIDENCE", line)
        note("time-gap", "t_s", text, len(gaps))
    _check_rate(usual_s, rig, file)
    clipped: Clipped = {}
    for name in [name for name in usable if name != "t_s"]:
        values = usable[name]
        seen = look(values, dwells=name.endswith("_m"))
        wrong = _wrong_unit(name, values, rig) or _too_far(name, usable, rig, table)
        if wrong and name in VIBRATION:
            raise Fault("BAD_EVIDENCE", f"{file}: {name}: {wrong}; set channels.{name}.scale")
        if wrong:
            note(WRONG_UNIT, name, f"{wrong}; not used; else set channels.{name}.unit or scale")
            del usable[name]
        elif seen.constant and not name.startswith("vibration") and name not in FURTHER:
            used = "; not used" if name in CHANNELS and name != "drive_position_m" else ""
            note("constant", name, f"is {seen.lowest:g} in every row{used}", seen.samples)
            if used:
                del usable[name]
        elif (seen.clipped_high or seen.clipped_low) and name in CHANNELS:
            for times, limit in ((seen.clipped_high, seen.highest), (seen.clipped_low, seen.lowest)):
                if times:
                    row = int(rows[np.flatnonzero(values == limit)[0]]) + 1
                    text = f"{counted(times, 'sample')} at {limit:g}, first row {row}; so are the model's"
                    note("clipped", name, text, times)
            lowest = seen.lowest if seen.clipped_low else -math.inf
            clipped[name] = lowest, seen.highest if seen.clipped_high else math.inf
    _compare_velocity(usable, rig, table, note)
    _check_moves(usable, rig, table, note)
    if (
        rig.drive_stiffness_N_per_m
        and "drive_force_N" in usable
        and _pulls_back(usable, table, rig.drive_stiffness_N_per_m)
    ):
        text = "pulls against the drive's motion: a positive force pulls towards larger positions; not used; change the sign of"
        note(WRONG_SIGN, "drive_force_N", f"{text} channels.drive_force_N.scale")
        del usable["drive_force_N"]
    _check_bending(usable, rig, note)
    return usable, clipped, findings


def _check_length(length_s: float, step_s: float, file: str) -> None:
    if length_s < _SHORTEST_S:
        remedy = "give a longer run"
        if step_s < _QUICKEST_S:
            remedy += f"; a sample every {step_s:.3g} s: is the column in seconds? If not, set channels.t_s.scale"
        raise Fault("BAD_EVIDENCE", f"{file}: t_s: {length_s:.3g} s long: must be {_SHORTEST_S:g} s at least; {remedy}")


def _check_rate(step_s: float, rig: RigTable, file: str) -> None:
    longest_s, why = _SLOWEST_S, ""
    if rig.drive_stiffness_N_per_m is not None:
        slip_s = math.pi * math.sqrt(rig.mass_kg / rig.drive_stiffness_N_per_m)
        longest_s = slip_s / _FEWEST_IN_A_SLIP
        why = f", a third of a slip, pi sqrt(mass / drive stiffness) = {slip_s:.3g} s"
    if step_s > longest_s:
        line = (
            f"{file}: t_s: a sample every {step_s:g} s: must be {longest_s:.3g} s at most{why}; is the column in ms? Then set "
            "channels.t_s.scale = 0.001; or record faster"
        )
        raise Fault("BAD_EVIDENCE", line)


def _check_shape(columns: Columns, file: str) -> None:
    if "t_s" not in columns:
        has = ", ".join(columns) or "no standard column"
        raise Fault("BAD_EVIDENCE", f"{file}: t_s: missing; the file has {has}; add the column or map it in [channels]")
    rows = len(columns["t_s"])
    if rows < _FEWEST_ROWS:
        line = f"{file}: t_s: {counted(rows, 'row')}: must have {_FEWEST_ROWS} at least; give a longer run"
        raise Fault("BAD_EVIDENCE", line)
    for name, values in columns.items():
        if len(values) != rows:
            line = f"{file}: {name}: {counted(len(values), 'row')}: must have {rows}, as t_s: one value a sample"
            raise Fault("BAD_EVIDENCE", line)


def _good_rows(
    columns: Columns, rig: RigTable, file: str, findings: list[Finding]
) -> tuple[Columns, npt.NDArray[np.int64]]:
    """Rows with finite, possible values that are later than every row before; and the indices of these rows.

    Adds to `findings`. Raises Fault BAD_EVIDENCE when too few rows are left.
    """
    t_s = columns["t_s"]
    rows = len(t_s)
    good = np.ones(rows, np.bool_)
    new_findings: list[Finding] = []
    for name, values in columns.items():
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            text = f"{counted(len(bad), 'sample is', 'samples are')} no finite number, first row {bad[0] + 1}; not used"
            new_findings.append(Finding("not-finite", f"{file}: {name}", text, len(bad)))
            good[bad] = False
        limit = _FORCE_FACTOR * rig.static_force_N if name == "drive_force_N" else STANDARD[name].largest
        wild = np.flatnonzero(np.isfinite(values) & (np.abs(values) > limit))
        # a larger share of impossible values means a wrong unit: `_wrong_unit` reports it
        if not name.endswith("position_m") and 0 < len(wild) <= _LARGEST_WILD_SHARE * rows:
            at = int(wild[0])
            many = counted(len(wild), "sample is", "samples are")
            text = f"{many} beyond {limit:g}, first row {at + 1}: {values[at]:g}; not used"
            new_findings.append(Finding("wild", f"{file}: {name}", text, len(wild)))
            good[wild] = False
    latest_s = np.maximum.accumulate(np.where(np.isfinite(t_s), t_s, -np.inf))
    repeated = np.zeros(rows, np.bool_)
    repeated[1:] = np.isfinite(t_s[1:]) & (t_s[1:] <= latest_s[:-1])
    back = np.flatnonzero(repeated)
    if len(back):
        at = int(back[0])
        text = (
            f"{counted(len(back), 'row is', 'rows are')} not later than the row before, first row {at + 1}: "
            f"{t_s[at]:.9g} s after {latest_s[at - 1]:.9g} s; not used"
        )
        new_findings.append(Finding("time", f"{file}: t_s", text, len(back)))
        good[back] = False
    lost = rows - int(good.sum())
    if lost > _LARGEST_BAD_SHARE * rows or rows - lost < _FEWEST_ROWS:
        worst = max(new_findings, key=lambda finding: finding.times)
        rule = f"must be below {100 * _LARGEST_BAD_SHARE:g} %"
        if rows - lost < _FEWEST_ROWS:
            rule = f"{_FEWEST_ROWS} rows must be left"
        remedy = "repair the file, or cut it before the first bad row"
        if len(back) and worst.kind == "time" and (np.diff(t_s[np.isfinite(t_s)]) >= 0.0).all():
            remedy = (
                "time repeats but never goes back: write it with more digits, or give `stickslip log import` the "
                "source.sample_rate_Hz in place of channels.t_s"
            )
        line = f"{worst.where}: {worst.text}: {lost} of {rows} rows cannot be used: {rule}; {remedy}"
        raise Fault("BAD_EVIDENCE", line)
    findings += new_findings
    return ({name: values[good] for name, values in columns.items()} if lost else columns), np.flatnonzero(good)


def _wrong_unit(name: str, values: Floats, rig: RigTable) -> str:
    """Reason why the unit of a column cannot be right; empty when it can."""
    size = float(np.abs(values).max())
    if name == "drive_force_N":
        static_N = rig.static_force_N
        factor = size / static_N
        if factor > _FORCE_FACTOR or 0.0 < factor < 1.0 / _FORCE_FACTOR:
            return f"largest value {size:g} N, {factor:.2g} times rig.static_force_N = {static_N:g}: the unit cannot be right"
        return ""
    if name.endswith("position_m"):
        size = float(np.ptp(values))
    limit = STANDARD[name].largest
    if rig.radius_m is not None and name.endswith("position_m"):
        limit *= _MOST_TURNS
    if size > limit:
        angle = '; an angle? A rotary rig has drive = "torsion"' if name.endswith("position_m") else ""
        return f"reaches {size:g}: must be below {limit:g}, the unit cannot be right{angle}"
    return ""


def _too_far(name: str, columns: Columns, rig: RigTable, table: RunTable) -> str:
    """Reason why a position cannot be in metres, from the known motion of the drive; empty when it can."""
    if rig.drive_stiffness_N_per_m is None or not name.endswith("position_m"):
        return ""
    if table.drive_velocity_mps:
        drive_m = abs(table.drive_velocity_mps) * float(columns["t_s"][-1] - columns["t_s"][0])
    elif "drive_position_m" in columns:
        drive_m = float(np.ptp(columns["drive_position_m"]))
    else:
        return ""
    furthest_m = _MOST_TRAVEL * (drive_m + rig.static_force_N / rig.drive_stiffness_N_per_m)
    travel_m = float(np.ptp(columns[name]))
    if travel_m <= furthest_m:
        return ""
    return f"travels {travel_m:.3g}: the drive moves by {drive_m:.3g} m in this time, the unit cannot be right"


def _compare_velocity(columns: Columns, rig: RigTable, table: RunTable, note: Note) -> None:
    if rig.drive == "force":
        return
    stated_mps, moved_mps = table.drive_velocity_mps, 0.0
    if "drive_position_m" in columns:
        t_s, position_m = columns["t_s"], columns["drive_position_m"]
        travel_m = float(position_m[-1] - position_m[0])
        measured_mps = travel_m / float(t_s[-1] - t_s[0])
        moved_mps = _way_m(t_s, position_m) / float(t_s[-1] - t_s[0])  # both directions count as positive
        if stated_mps is not None:
            text = (
                f"moves at {measured_mps:.4g} m/s on average, but drive_velocity_mps = {stated_mps:.4g}: check units and time; "
                "where the drive changes its speed leave drive_velocity_mps out"
            )
            reach_m = rig.static_force_N / (rig.drive_stiffness_N_per_m or math.inf)
            another = (
                not 1.0 / _OTHER_RUN_FACTOR < measured_mps / stated_mps < _OTHER_RUN_FACTOR
                if stated_mps
                else abs(travel_m) > reach_m
            )
            if another:
                raise Fault("BAD_EVIDENCE", f"{table.name}: drive_position_m: {text}")
            if abs(measured_mps - stated_mps) > _VELOCITY_TOLERANCE * abs(stated_mps) > 0.0:
                note("units", "drive_position_m", f"{text}; the stated velocity is used")
    where = "drive_position_m" if stated_mps is None else "drive_velocity_mps"
    fastest_mps = moved_mps if stated_mps is None else abs(stated_mps)
    if fastest_mps > _FASTEST * rig.stribeck_velocity_mps:
        times = fastest_mps / rig.stribeck_velocity_mps
        note(WRONG_UNIT, where, f"{fastest_mps:.3g} m/s, {times:.3g} times rig.stribeck_velocity_mps: is it in mm?")


def _way_m(t_s: Floats, position_m: Floats) -> float:
    """Length of the way of a position [samples], measured in strides, so that noise does not add up."""
    at = np.searchsorted(t_s, np.arange(t_s[0], t_s[-1], _STRIDE_S))
    return float(np.abs(np.diff(position_m[[*at, -1]])).sum())


def _check_moves(columns: Columns, rig: RigTable, table: RunTable, note: Note) -> None:
    """Report a drive that does not move: such a run fits nearly every rig."""
    if rig.drive_stiffness_N_per_m is None:
        return
    if "drive_position_m" in columns:
        where, travel_m = "drive_position_m", float(np.ptp(columns["drive_position_m"]))
    elif table.drive_velocity_mps is not None:
        t_s = columns["t_s"]
        where, travel_m = "drive_velocity_mps", abs(table.drive_velocity_mps) * float(t_s[-1] - t_s[0])
    else:
        return
    share = travel_m * rig.drive_stiffness_N_per_m / rig.static_force_N
    if share < _LEAST_TRAVEL:
        text = f"{travel_m:.2g} m in all, {share:.2g} of the travel to the first slip: the drive rests during the run"
        note("still", where, f"{text}: friction and drive are not tested")


def _check_bending(columns: Columns, rig: RigTable, note: Note) -> None:
    """Delete a mass acceleration with the wrong sign; report a mass or a drive stiffness in another unit."""
    described = rig.drive_stiffness_N_per_m
    even = _on_even_bins(columns["t_s"], columns) if described else None
    if not described or even is None:
        return
    largest_N, largest_mps2 = (
        float(np.abs(values[even.quiet]).max(initial=0.0)) for values in (even.force_N, even.accel_mps2)
    )
    apparent = _stiffness_N_per_m(even)
    if apparent is not None and apparent < 0.0:
        text = "has the wrong sign: the mass seems to accelerate against the force; not used; change the sign of"
        note(WRONG_SIGN, "mass_accel_mps2", f"{text} channels.mass_accel_mps2.scale")
        del columns["mass_accel_mps2"]
    elif apparent is not None and not 1.0 / _OTHER_UNIT_FACTOR < apparent / described < _OTHER_UNIT_FACTOR:
        text = (
            f"with mass_accel_mps2 shows a drive stiffness of {apparent:.2g} N/m, "
            f"but rig.drive_stiffness_N_per_m = {described:g}: check the units of these three"
        )
        note(WRONG_UNIT, "drive_force_N", text)
    elif rig.mass_kg * largest_mps2 > _OTHER_UNIT_FACTOR * largest_N > 0.0:
        # Drive and friction together accelerate a mass by 2 F / m at most
        text = (
            f"= {rig.mass_kg:g} times the largest acceleration, {largest_mps2:.3g} m/s2, is "
            f"{rig.mass_kg * largest_mps2:.3g} N, but the drive pulls with {largest_N:.3g} N at most: is the mass in g?"
        )
        note(WRONG_UNIT, "rig.mass_kg", text)


def _pulls_back(columns: Columns, table: RunTable, stiffness_N_per_m: float) -> bool:
    """Whether the drive receives more work than a loaded spring can hold. Friction returns no work, so the sign is wrong."""
    force_N, t_s = columns["drive_force_N"], columns["t_s"]
    if "drive_position_m" in columns:
        work_J = float(force_N[1:] @ np.diff(columns["drive_position_m"]))
    else:
        work_J = float(force_N.mean()) * (table.drive_velocity_mps or 0.0) * float(t_s[-1] - t_s[0])
    return work_J < -0.5 * float(np.abs(force_N).max()) ** 2 / stiffness_N_per_m


class _EvenBins(NamedTuple):
    """Force and mass acceleration, smoothed, in bins of `_BIN_S`, [bins]; `quiet` is true away from a vibration."""

    force_N: Floats
    accel_mps2: Floats
    quiet: npt.NDArray[np.bool_]


def _on_even_bins(t_s: Floats, columns: Mapping[str, Floats]) -> _EvenBins | None:
    """None where a column is missing or the run is too short or slow for bins."""
    if not {"drive_force_N", "mass_accel_mps2"} <= columns.keys():
        return None
    number = np.floor((t_s - t_s[0]) / _BIN_S).astype(np.int64)
    samples = np.bincount(number)
    if len(samples) < _FEWEST_BINS or (samples == 0).any():
        return None
    force_N, accel_mps2 = (
        gaussian_filter1d(np.bincount(number, columns[name]) / samples, _SMOOTH_BINS)
        for name in ("drive_force_N", "mass_accel_mps2")
    )
    vibrates = np.zeros(len(samples))
    if "vibration_amplitude_m" in columns:
        vibrates = np.bincount(number, np.abs(columns["vibration_amplitude_m"]) > 0.0)
    return _EvenBins(force_N, accel_mps2, maximum_filter1d(vibrates, _BESIDE_BINS) == 0.0)


def _stiffness_N_per_m(even: _EvenBins) -> float | None:
    """The drive's stiffness from force and mass acceleration; below 0 when one of the two has the wrong sign.

    A drive that moves evenly pulls with F = k (s - x). So F'' = -k x'' in every slip, for any friction and without a rig number.
    None where the two do not correlate. The stiffness neglects the motion of the drive, so it is good for a sign and a unit only.
    """
    quiet = even.quiet[1:-1]
    bent = np.diff(even.force_N, 2)[quiet] / _BIN_S**2
    moved = even.accel_mps2[1:-1][quiet]
    if len(moved) < _FEWEST_BINS or np.ptp(moved) == 0.0 or np.ptp(bent) == 0.0:
        return None
    if abs(float(np.corrcoef(bent, moved)[0, 1])) < _LEAST_CORRELATION:
        return None
    return -float(bent @ moved) / float(moved @ moved)
