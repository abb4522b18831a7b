"""Reads a measured file and the given facts into one record; reports its assumptions as findings and as a map to correct."""

import json
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from bridge.arrays import Bools, Floats
from bridge.config import read_toml, validate
from bridge.faults import Fault
from bridge.log.finding import Finding
from bridge.tables.kinds import kind_of
from bridge.tables.readers import Dialect, read_table
from bridge.tables.table import Table
from bridge.tables.unit_words import known_unit
from cockpit.look.findings import of_time, of_values, tare_of
from cockpit.look.units import counts, own_unit, quantity, si, unitless
from diagnosis.evidence.import_table import ImportMap
from diagnosis.evidence.manifest_keys import USUAL, ChannelMap, Columns
from diagnosis.evidence.mapped import has_time, mapped, piece_of
from diagnosis.evidence.run_log import LoggedRun, columns_of_log
from diagnosis.look.guess import Guess, guess, no_time, unused
from diagnosis.look.look import LookResult, RecordFacts, look
from diagnosis.look.motion import lag_of
from diagnosis.look.slips import FEWEST
from diagnosis.look.sticks import is_of_slide

# Shortest stretch without vibration that is looked at. Shorter: stops and turns of the drive between two vibrations count as
# swings, 1.5 s in docs/guides/describe-an-axis.md. Longer: the controller's trials without vibration, 5 s, are left out.
_ALONE_S = 2.0
_LOOKED_AT = ("t_s", "drive_force_N", "drive_position_m")


class LookOptions(NamedTuple):
    """Options of the command line, SI units; None or empty: not given."""

    speed_mps: float | None = None
    load_N: float | None = None
    mass_kg: float | None = None
    rate_Hz: float | None = None
    time: str = ""
    force: str = ""
    map: Path | None = None
    speed_turns: bool | None = None  # the given speed is angular; None: no speed is given
    position: str = ""
    piece: int | None = None  # from 1; None: all
    encoding: str | None = None

    @property
    def channels(self) -> dict[str, ChannelMap]:
        """The columns that the options name."""
        named = {"t_s": self.time, "drive_force_N": self.force, "drive_position_m": self.position}
        return {name: ChannelMap(column=column) for name, column in named.items() if column}


class MeasuredRecord(NamedTuple):
    """A record, [samples] each, SI units."""

    path: Path
    t_s: Floats
    force_N: Floats
    position_m: Floats | None  # position of the drive
    others: Columns  # every other standard column: motion of the slide and of the base, commanded vibration
    known: RecordFacts
    findings: list[Finding]
    rig: Mapping[str, float]  # numbers of [rig] that a run log describes; empty for another file
    map_text: str  # map that reproduces this reading; empty if a map was given, or for a run log
    starts_s: tuple[float, ...] = ()  # start of each piece of a file whose time begins again
    counts: str = ""  # column of the time, if it holds whole numbers without a unit, as of milliseconds

    @property
    def free(self) -> Bools:
        """True for samples in long stretches without a commanded vibration, which hides stick, slip and swing of the slide."""
        free = np.ones(len(self.t_s), np.bool_)
        if "vibration_amplitude_m" not in self.others:
            return free
        vibrates = self.others["vibration_amplitude_m"] > 0.0
        limits = [0, *(np.flatnonzero(np.diff(vibrates)) + 1).tolist(), len(free)] if vibrates.any() else []
        for first, end in pairwise(limits):
            free[first:end] = not vibrates[first] and self.t_s[end - 1] - self.t_s[first] >= _ALONE_S
        return free


def read_record(path: Path, asked: LookOptions) -> MeasuredRecord:
    """Read a table or a run log. Raises Fault BAD_TABLE, BAD_LOG, CONFIG."""
    if path.is_file() and kind_of(path) == "mcap" and (logged := _logged(path)) is not None:
        known = RecordFacts(asked.speed_mps, asked.load_N, asked.mass_kg)
        return _record(path, logged.columns, known, logged.findings, "", logged.rig)
    if asked.map is not None:
        wanted = validate(ImportMap, read_toml(asked.map), asked.map.name)
        record = _by_map(path, asked, overridden(wanted, asked))
    else:
        record = _by_names(read_table(path, Dialect(encoding=asked.encoding)), asked)
    return _piece(record, asked.piece)


def overridden(wanted: ImportMap, asked: LookOptions) -> ImportMap:
    """A map in which the options of the command line replace its keys."""
    source, run, rig = wanted.source, wanted.run, wanted.rig
    channels = wanted.channels | asked.channels
    if asked.encoding:
        source = source.model_copy(update={"encoding": asked.encoding})
    if asked.rate_Hz:
        source = source.model_copy(update={"sample_rate_Hz": asked.rate_Hz})
    if asked.speed_mps is not None:
        run = run.model_copy(update={"drive_velocity_mps": asked.speed_mps})
    if asked.mass_kg is not None and rig:
        rig = rig | {"mass_kg": asked.mass_kg}
    return wanted.model_copy(update={"source": source, "channels": channels, "run": run, "rig": rig})


def _by_map(path: Path, asked: LookOptions, wanted: ImportMap) -> MeasuredRecord:
    """The record as a map describes it."""
    table = read_table(path, wanted.source.dialect, wanted.source.format)
    columns, findings, starts_s = mapped(table, wanted.channels, wanted.source.sample_rate_Hz)
    findings += [
        *of_values(table, _as_read(wanted.channels, columns), findings),
        *of_time(columns["t_s"], f"{path.name}: t_s"),
    ]
    if asked.speed_mps is not None:
        columns.pop("drive_position_m", None)
    mass_kg = asked.mass_kg if asked.mass_kg is not None else wanted.rig.get("mass_kg")
    known = RecordFacts(wanted.run.drive_velocity_mps, asked.load_N, mass_kg)
    return _record(path, columns, known, findings, "")._replace(starts_s=starts_s)


def _by_names(table: Table, asked: LookOptions) -> MeasuredRecord:
    """The record by the names, units and values of the columns."""
    path = table.path
    guessed = guess(table, {"time": asked.time, "force": asked.force, "position": asked.position})
    channels = _channels(table, guessed) | asked.channels
    findings = [Finding("assumed", path.name, "; ".join(guessed.reasons))] if guessed.reasons else []
    if asked.rate_Hz is None and not has_time(table, channels):
        raise Fault("CONFIG", f"{path.name}: no time: {no_time(table)}")
    unit = own_unit(table, guessed, channels, findings)
    torsion = bool(guessed.force) and not unit and quantity(table, channels["drive_force_N"]) == "torque"
    if asked.speed_turns not in (None, torsion):
        kind, example = ("torque", "10mrad/s or 5rpm") if torsion else ("force", "0.5mm/s")
        raise Fault("CONFIG", f"--speed: {guessed.force!r} is a {kind}: must be a speed such as {example}")
    if column := guessed.position:
        rows = len(table.columns[table.find(channels["drive_force_N"].column)])
        if torsion and quantity(table, channels["drive_position_m"]) == "length":
            del channels["drive_position_m"]  # on a turning rig a length is a displacement along the axis
        elif asked.rate_Hz and len(table.columns[column]) != rows:
            del channels["drive_position_m"]
            text = "has another number of rows than the force, and --rate is the rate of the force: not used"
            findings.append(Finding("unused", f"{path.name}: {column}", text))
    guessed = guessed if "drive_position_m" in channels else guessed._replace(position="")
    columns, of_columns, starts_s = mapped(table, channels, asked.rate_Hz)
    findings += [*of_columns, *unitless(table, channels, bool(asked.rate_Hz))]
    if guessed.stands_in == "a position":
        columns["drive_force_N"], speed_mps = lag_of(columns["t_s"], columns["drive_force_N"])
        asked = asked._replace(speed_mps=asked.speed_mps or speed_mps)
        text = f"column {guessed.force} is a position: how far it lies behind an even motion is looked at"
        findings.append(Finding("lag", path.name, text))
    if torsion:
        text = f"{guessed.force!r} is a torque: the rig turns, so positions are angles in rad"
        findings.append(Finding("assumed", path.name, text))
    load_N, of_load = None if unit else asked.load_N, not guessed.force and bool(guessed.coefficient)
    if load_N is None and guessed.load and not torsion and not unit:
        loads_N = si(table, guessed.load, "N", findings)
        findings += of_values(table, {guessed.load: loads_N}, table.findings)
        load_N = float(np.nanmean(np.abs(loads_N))) or None
        text = (
            f"load = mean of {guessed.load!r}, {load_N:.6g} N"
            if load_N
            else f"{guessed.load!r} is 0 throughout: no load; add --load 94.5N"
        )
        findings.append(Finding("assumed", path.name, text))
    if of_load:
        factor = load_N or 1.0
        columns["drive_force_N"] = columns["drive_force_N"] * factor
        of_map = channels["drive_force_N"]
        channels["drive_force_N"] = of_map.model_copy(update={"scale": (of_map.scale or 1.0) * factor})
        text = f"force = {guessed.coefficient!r} times a load of {factor:g} N"
        if load_N is None:
            text = f"{guessed.coefficient!r} is a coefficient: the load is unknown; add --load 94.5N"
        findings.append(Finding("assumed", path.name, text))
    findings += [
        *of_values(table, _as_read(channels, columns), findings),
        *of_time(columns["t_s"], f"{path.name}: t_s"),
    ]
    zero_N, tare_findings = (
        (0.0, [])
        if unit
        else tare_of(columns["drive_force_N"], columns.get("drive_position_m"), f"{path.name}: drive_force_N")
    )
    findings += tare_findings
    if zero_N:
        columns["drive_force_N"] = columns["drive_force_N"] - zero_N
        channels["drive_force_N"] = channels["drive_force_N"].model_copy(update={"offset": -zero_N})
    if guessed.position and asked.speed_mps is not None:
        del columns["drive_position_m"], channels["drive_position_m"]
        findings.append(
            Finding("assumed", path.name, f"the speed is taken from --speed: {guessed.position!r} is not used")
        )
    elif guessed.position and is_of_slide(columns["t_s"], columns["drive_force_N"], columns["drive_position_m"]):
        del columns["drive_position_m"]
        channels["mass_position_m"] = channels.pop("drive_position_m")
        text = f"{guessed.position!r} is constant during the sticks: it belongs to the slide, and gives no drive speed"
        findings.append(Finding("assumed", path.name, f"{text}; add --speed 0.5mm/s"))
    if (
        guessed.speed
        and not guessed.position
        and asked.speed_mps is None
        and len(table.columns[guessed.speed]) == len(columns["t_s"])
    ):
        speed_mps = si(table, guessed.speed, "rad/s" if torsion else "m/s", findings)
        steps_m = 0.5 * (speed_mps[1:] + speed_mps[:-1]) * np.diff(columns["t_s"])
        columns["drive_position_m"] = np.concatenate([[0.0], np.nancumsum(steps_m)])
    if left := unused(table, guessed):
        findings.append(Finding("unused", path.name, f"columns: {', '.join(map(repr, left))}"))
    known = RecordFacts(asked.speed_mps, load_N, asked.mass_kg, of_load and load_N is None, torsion, unit)
    record = _record(path, columns, known, findings, "" if unit else map_text(table, channels, asked))
    return record._replace(starts_s=starts_s, counts=counts(table, channels))


def _piece(record: MeasuredRecord, piece: int | None) -> MeasuredRecord:
    """The record of one piece, or of all. Raises Fault CONFIG for a number without a piece."""
    if piece is None:
        return record
    inside = piece_of(record.t_s, record.starts_s, piece, record.path.name)
    return record._replace(
        t_s=record.t_s[inside],
        force_N=record.force_N[inside],
        position_m=None if record.position_m is None else record.position_m[inside],
        others={name: values[inside] for name, values in record.others.items()},
        starts_s=(),
    )


def pieces_of(record: MeasuredRecord) -> list[MeasuredRecord]:
    """The record of each piece; the record itself where its time does not begin again."""
    return [_piece(record, number) for number in range(1, len(record.starts_s) + 1)] or [record]


def looked_at(record: MeasuredRecord) -> LookResult:
    """Slips, friction, stiffness and mass from a record without its vibration. Raises Fault BAD_TABLE if it is too short."""
    free, position_m = record.free, record.position_m
    position_m = None if position_m is None else position_m[free]
    seen = look(record.t_s[free], record.force_N[free], position_m, record.known)
    if seen is None:
        line = f"{record.path.name}: fewer than 16 samples of a force with a time; give a longer record"
        raise Fault("BAD_TABLE", line)
    return seen


def _logged(path: Path) -> LoggedRun | None:
    """The run of an MCAP log; None without sensors of this project."""
    try:
        return columns_of_log(path)
    except Fault as fault:
        if fault.kind.code in ("BAD_LOG", "BAD_MESSAGE"):
            return None
        raise


def _record(
    path: Path,
    columns: dict[str, Floats],
    known: RecordFacts,
    findings: list[Finding],
    text: str,
    rig: Mapping[str, float] = MappingProxyType({}),
) -> MeasuredRecord:
    if "drive_force_N" not in columns:
        raise Fault("BAD_TABLE", f"{path.name}: has no drive_force_N: a force is needed; map a force in [channels]")
    complete, rows = int(np.count_nonzero(np.isfinite(columns["t_s"] + columns["drive_force_N"]))), len(columns["t_s"])
    if complete < min(FEWEST, rows):
        text = f"{path.name}: {complete} of {rows} rows have a time and a force: at least {FEWEST} are needed"
        raise Fault(
            "BAD_TABLE", f"{text}; name other columns, or let a spreadsheet program calculate and save its formulas"
        )
    position = columns.get("drive_position_m")
    if position is not None and (
        not np.isfinite(position).any() or float(np.nanmax(position) - np.nanmin(position)) == 0.0
    ):
        position = None
    others = {name: columns[name] for name in USUAL if name in columns and name not in _LOOKED_AT}
    record = MeasuredRecord(
        path, columns["t_s"], columns["drive_force_N"], position, others, known, findings, rig, text
    )
    free = record.free
    if free.all():
        return record
    remedy = "record the rig alone, or for longer before `controller.policy.enabled_from_s`"
    if not free.any():
        line = (
            f"{path.name}: vibrates, which hides stick and slip, and has no stretch of {_ALONE_S:g} s without vibration"
        )
        raise Fault("BAD_TABLE", f"{line}; {remedy}")
    line = f"the vibration hides stick and slip: {100.0 * free.mean():.0f} % of the samples are used, without vibration for"
    line = f"{line} {_ALONE_S:g} s or more; if they are too few, {remedy}"
    return record._replace(findings=[*findings, Finding("vibrated", path.name, line)])


def _channels(table: Table, guessed: Guess) -> dict[str, ChannelMap]:
    channels: dict[str, ChannelMap] = {}
    if guessed.time:
        channels["t_s"] = ChannelMap(column=guessed.time)
    if guessed.force:
        channels["drive_force_N"] = ChannelMap(column=guessed.force)
    else:
        known = known_unit(table.unit(guessed.coefficient))
        channels["drive_force_N"] = ChannelMap(column=guessed.coefficient, scale=known[1] if known else 1.0)
    if guessed.position:
        channels["drive_position_m"] = ChannelMap(column=guessed.position)
    return channels


def _as_read(channels: dict[str, ChannelMap], columns: dict[str, Floats]) -> dict[str, Floats]:
    """The values of the channels by the names of their columns in the table."""
    return {str(channel.column): columns[name] for name, channel in channels.items()}


def map_text(table: Table, channels: dict[str, ChannelMap], asked: LookOptions) -> str:
    """Map that reproduces the reading of the file, to correct and give to `--map`."""
    lines = [f"# columns of {table.path.name} as they were read; correct mistakes and give this file to --map"]
    source: dict[str, Any] = dict(table.written)
    source.pop("columns", None)
    channels = {name: channel for name, channel in channels.items() if name != "t_s" or asked.rate_Hz is None}
    if "t_s" not in channels and (rate_Hz := asked.rate_Hz or table.sample_rate_Hz):
        source["sample_rate_Hz"] = float(rate_Hz)
    if source:
        lines += [
            "[source]",
            *(f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in source.items()),
            "",
        ]
    lines.append("[channels]")
    for name, channel in channels.items():
        unit = channel.unit or table.unit(channel.column)
        keys = [f"column = {json.dumps(channel.column, ensure_ascii=False)}"]
        if channel.scale is not None:
            keys.append(f"scale = {channel.scale!r}")
        elif unit and known_unit(unit):
            keys.append(f"unit = {json.dumps(unit, ensure_ascii=False)}")
        if channel.offset:
            keys.append(f"offset = {channel.offset!r}")
        lines.append(f"{name} = {{ {', '.join(keys)} }}")
    if asked.speed_mps is not None:
        lines += ["", "[run]", f"drive_velocity_mps = {asked.speed_mps!r}"]
    return "\n".join(lines) + "\n"
