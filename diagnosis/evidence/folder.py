"""Reading of an evidence folder: the rig as described, the runs as float64 arrays in SI units, and the findings.

Data that cannot be used is left out and reported as a finding. When nothing usable remains, a Fault is raised.
"""

from collections.abc import Iterator
from difflib import get_close_matches
from pathlib import Path

import numpy as np

from bridge.arrays import Floats
from bridge.faults import Fault
from bridge.files import check_file
from bridge.log.finding import Finding
from bridge.tables.readers import Table, read_table
from bridge.units import counted
from bridge.wire.channels import SENSOR_CHANNELS
from diagnosis.evidence.assumed import WIDE
from diagnosis.evidence.column_checks import WRONG_SIGN, checked
from diagnosis.evidence.conversion import as_sliding, run_as_sliding, told, with_beside
from diagnosis.evidence.foreign_vibration import foreign_vibrations
from diagnosis.evidence.manifest import MANIFEST, Manifest, RigTable, RunTable, described
from diagnosis.evidence.manifest_keys import STANDARD, VIBRATION, ChannelMap, Columns, SourceMap
from diagnosis.evidence.mapped import has_time, mapped, piece_of
from diagnosis.evidence.run import Evidence, MeasuredRun
from diagnosis.evidence.run_log import columns_of_log
from diagnosis.evidence.split import split
from diagnosis.evidence.unknown_mass import shown_mass_kg

_NO_COLUMN = "column"  # kind of finding: the file lacks a column that the channel map names
_NEVER_EXACT = ("coulomb_force_N", "static_force_N", "stribeck_velocity_mps", "drive_stiffness_N_per_m")
# Similarity of two column names (`difflib`) from which one may be a misspelling of the other: one letter, or the case, differs.
# Too small: unrelated columns are offered. Too large: misspellings stay unseen.
_SIMILAR = 0.85
# lowest sampling rate at which the rms within 1 ms is compared: lower rates have too few samples
SHAKE_RATE_HZ = 8000.0


def load_evidence(folder: Path) -> Evidence:
    """Read and check an evidence folder.

    When the manifest holds out no run, the last of several runs is held out, or a part of a single long run.

    Raises Fault BAD_EVIDENCE: file, key or column, row, expectation, remedy.
    """
    manifest, assumed = described(folder)
    for table in manifest.run:
        _refuse_a_way_out(folder, table.file)
        check_file(folder / table.file, "BAD_EVIDENCE", f"correct run.file in {MANIFEST}, or copy the file there")
    read = _read_all(folder, manifest)
    _refuse_misspelt(manifest, [finding for _, findings in read for finding in findings])
    seen_kg: float | None = None
    if "mass_kg" in assumed:
        shown = (
            shown_mass_kg(manifest.rig, table, with_beside(columns, manifest.rig, table)[0])
            for table, (columns, _) in zip(manifest.run, read, strict=True)
        )
        seen_kg = next((mass_kg for mass_kg in shown if mass_kg is not None), None)
        manifest, assumed = described(folder, seen_kg)
    runs: list[MeasuredRun] = []
    findings = told(manifest.rig)
    findings += [
        Finding("assumed", f"{MANIFEST}: rig.{name}", _assumed_in_words(name, manifest.rig, seen_kg is not None))
        for name in assumed
    ]
    findings += [
        Finding(
            "tolerance", f"{MANIFEST}: rig.tolerance.{name}", "is relative, and 0 is described: counts as known exactly"
        )
        for name, share in manifest.rig.tolerance.items()
        if share > 0.0 and manifest.rig.values()[name] == 0.0
    ]
    if exact := [name for name in _NEVER_EXACT if manifest.rig.values()[name] and not manifest.rig.tolerance.get(name)]:
        text = f"missing for {', '.join(exact)}: counts as known exactly, so an ordinary deviation will be called an effect"
        findings.append(Finding("tolerance", f"{MANIFEST}: rig.tolerance", text))
    for table, (columns, damaged) in zip(manifest.run, read, strict=True):
        run, noted = examine(columns, manifest.rig, table)
        runs.append(run)
        findings += damaged + noted
    if len(runs) > 1 and not any(run.holdout for run in runs):
        # with a finding, as the choice changes when a run is added
        runs[-1] = runs[-1]._replace(holdout=True)
        text = "no run is marked holdout: this one is held out; mark one to choose for yourself"
        findings.append(Finding("holdout", runs[-1].file, text))
    elif len(runs) == 1:
        runs, split_findings = split(runs[0])
        findings += split_findings
    return Evidence(folder, as_sliding(manifest.rig), tuple(runs), tuple(findings), tuple(assumed))


def _read_all(folder: Path, manifest: Manifest) -> list[tuple[Columns, list[Finding]]]:
    """The columns of every run and their findings; a file that several runs share is read once."""
    known: dict[str, tuple[Columns, list[Finding]]] = {}
    result: list[tuple[Columns, list[Finding]]] = []
    for table in manifest.run:
        channels = manifest.channels | table.channels
        key = f"{table.file} {table.source} {table.piece} {sorted(channels.items())}"
        rotary = manifest.rig.drive == "torsion"
        columns, notes = known.get(key) or read_columns(
            folder / table.file, channels, rotary, table.source, table.piece
        )
        result.append((_stretch(columns, table), [] if key in known else notes))
        known[key] = (columns, notes)
    return result


def _stretch(columns: Columns, table: RunTable) -> Columns:
    """The part of a file that is a run; its limits count from the first sample with a finite time."""
    if table.from_s == 0.0 and table.until_s is None:
        return columns
    t_s = columns["t_s"]
    since_s = t_s - t_s[np.isfinite(t_s)][0] if np.isfinite(t_s).any() else t_s
    inside = (since_s >= table.from_s) & (since_s < (np.inf if table.until_s is None else table.until_s))
    if not inside.any():
        line = f"{table.name}: from_s = {table.from_s:g}: must be before its end at {np.nanmax(since_s):.6g} s"
        raise Fault("BAD_EVIDENCE", f"{line}; correct it in [[run]]")
    return {name: values[inside] for name, values in columns.items()}


def _assumed_in_words(name: str, rig: RigTable, mass_is_seen: bool) -> str:
    value = f"left out: taken as {getattr(rig, name):.6g}"
    if name not in WIDE:
        return value
    how = ", as the runs show it" if name == "mass_kg" and mass_is_seen else ""
    return f"{value}{how}; a third or three times as much is possible, so it decides nothing"


def _refuse_a_way_out(folder: Path, file: str) -> None:
    """Raise Fault BAD_EVIDENCE for a run that links to a file outside its folder: that file may be confidential."""
    if not (folder / file).resolve().is_relative_to(folder.resolve()):
        line = f"{MANIFEST}: run.file = {file!r}: is a link that leads out of the folder: must be a file in it"
        raise Fault("BAD_EVIDENCE", f"{line}; copy the file there")


def _refuse_misspelt(manifest: Manifest, findings: list[Finding]) -> None:
    """Raise Fault BAD_EVIDENCE for a mapped column that no run has: it is misspelt. A column that some runs lack is missing."""
    tables = sum(not table.file.endswith(".mcap") for table in manifest.run)
    for name in manifest.channels:
        lacking = [
            finding for finding in findings if finding.kind == _NO_COLUMN and finding.where.endswith(f": {name}")
        ]
        if len(lacking) == tables > 0:
            line = f"{lacking[0].where.partition(':')[0]}: {lacking[0].text}"
            raise Fault("BAD_EVIDENCE", f"{line}; no run has it: correct channels.{name}.column")


def examine(columns: Columns, rig: RigTable, table: RunTable) -> tuple[MeasuredRun, list[Finding]]:
    """A checked run from its raw columns ([samples], SI units), and the findings about it.

    Raises Fault BAD_EVIDENCE when the run cannot be used, or lacks a column that this kind of drive needs.
    """
    columns, besides = with_beside(columns, rig, table)
    columns, table = run_as_sliding(rig, columns, table)
    rig = as_sliding(rig)
    usable, clipped, findings = checked(columns, rig, table)
    findings = besides + findings
    reasons = "; ".join(f"{finding.where}: {finding.text}" for finding in findings if finding.kind != "clipped")

    def refuse(rule: str) -> Fault:
        return Fault("BAD_EVIDENCE", f"{table.name}: {rule}" + (f" ({reasons})" if reasons else ""))

    has = ", ".join(sorted(usable)) or "nothing"
    if rig.drive == "force" and "drive_force_N" not in usable:
        raise refuse(f'drive_force_N: missing; with drive = "force" it is the input; it has {has}')
    if not {"drive_force_N", "mass_accel_mps2"} & usable.keys():
        raise refuse(f"has {has}: must have drive_force_N or mass_accel_mps2; map one in [channels]")
    if rig.drive == "force" and not {"mass_accel_mps2", "mass_position_m"} & usable.keys():
        raise refuse(f'has {has}: with drive = "force" must have mass_accel_mps2 or mass_position_m; map one')
    if rig.drive == "spring" and "drive_position_m" not in usable and table.drive_velocity_mps is None:
        raise refuse("drive_velocity_mps: missing in [[run]]; without the column drive_position_m it is needed")
    for name, channel in SENSOR_CHANNELS.items():
        consequence = channel.without if rig.drive == "spring" else channel.without_force_drive
        if consequence and name not in usable:
            findings.append(Finding("missing", f"{table.name}: {name}", f"missing: {consequence}"))
    t_s = usable.pop("t_s")
    findings += [Finding(kind, f"{table.name}: {name}", text) for kind, name, text in _vibration(usable, t_s)]
    foreign = foreign_vibrations(rig, t_s, usable)
    findings += [Finding(shaken.kind, f"{table.name}: {shaken.column}", shaken.text) for shaken in foreign]
    return MeasuredRun(table.name, t_s, usable, clipped, table.drive_velocity_mps, table.holdout, foreign), findings


def _vibration(columns: Columns, t_s: Floats) -> Iterator[tuple[str, str, str]]:
    """Kind, column and text of each finding about the commanded vibration."""
    given = [name for name in VIBRATION if name in columns]
    if len(given) == 1:
        text = "is given alone: frequency and amplitude are needed; the run counts as a run without vibration"
        yield "missing", given[0], text
    for name in given:
        if negative := int((columns[name] < 0.0).sum()):
            many = counted(negative, "sample is", "samples are")
            yield WRONG_SIGN, name, f"{many} negative: must be positive, or 0 where the vibration is off; not used"
    rate_Hz = (len(t_s) - 1) / float(t_s[-1] - t_s[0])
    if len(given) == 2 and columns["vibration_amplitude_m"].any() and rate_Hz < SHAKE_RATE_HZ:
        text = f"{rate_Hz:.4g} Hz, below {SHAKE_RATE_HZ:g} Hz: the strength of its vibration is not compared"
        yield from (("rate", name, text) for name in ("mass_accel_mps2", "base_accel_mps2") if name in columns)


def read_columns(
    path: Path,
    channels: dict[str, ChannelMap],
    rotary: bool = False,
    source: SourceMap = SourceMap(),  # noqa: B008  immutable
    piece: int | None = None,
) -> tuple[Columns, list[Finding]]:
    """The standard columns of a data file, mapped and in SI units but not checked; and findings about missing columns and damage.

    A run log has the standard columns; a column that `channels` maps is scaled as in any other file. Raises Fault BAD_EVIDENCE.
    """
    try:
        if path.suffix == ".mcap":
            logged, damaged, _ = columns_of_log(path)
            return {name: _scaled(values, channels.get(name), name) for name, values in logged.items()}, damaged
        table = read_table(path, source.dialect, source.format)
        wanted, lacking = _wanted(table, channels)
        if source.sample_rate_Hz is None and not has_time(table, wanted):
            has = ", ".join(wanted) or "no standard column"
            line = f"{path.name}: t_s: missing; the file has {has}; add the column or map it in [channels]"
            raise Fault("BAD_EVIDENCE", line)
        standard, noted, starts_s = mapped(table, wanted, source.sample_rate_Hz, rotary)
        if piece is not None:
            inside = piece_of(standard["t_s"], starts_s, piece, path.name, "run.piece =")
            standard = {name: values[inside] for name, values in standard.items()}
        elif starts_s:
            line = f"{path.name}: t_s: begins again: holds {len(starts_s)} runs, and must hold one; give piece = 1 in [[run]]"
            raise Fault("BAD_EVIDENCE", f"{line}; `stickslip log import {path.name} --out FOLDER` makes a run of each")
    except Fault as fault:
        line = fault.line if path.name in fault.line else f"{path.name}: {fault.line}"
        raise Fault("BAD_EVIDENCE", line) from None
    return standard, [*lacking, *noted, *_misspelt(path.name, standard, table)]


def _wanted(table: Table, channels: dict[str, ChannelMap]) -> tuple[dict[str, ChannelMap], list[Finding]]:
    """The channels whose column, mapped or with a standard name, exists; and a finding for each missing mapped column."""
    wanted: dict[str, ChannelMap] = {}
    lacking: list[Finding] = []
    for name in STANDARD:
        if name in channels:
            try:
                table.find(channels[name].column)
            except Fault as fault:
                if name == "t_s":
                    raise
                lacking.append(Finding(_NO_COLUMN, f"{table.path.name}: {name}", fault.line.partition(": ")[2]))
                continue
            wanted[name] = channels[name]
        elif name in table.columns:
            wanted[name] = ChannelMap(column=name, scale=1.0)
    return wanted, lacking


def _misspelt(file: str, columns: Columns, table: Table) -> Iterator[Finding]:
    """A finding for each unused column with nearly the name of a missing standard column."""
    for name in STANDARD:
        near = [] if name in columns else get_close_matches(name, table.columns.keys() - columns.keys(), 1, _SIMILAR)
        for similar in near:
            yield Finding(
                "missing",
                f"{file}: {name}",
                f'missing, but {similar} is present: set channels.{name}.column = "{similar}"',
            )


def _scaled(values: Floats, channel: ChannelMap | None, name: str) -> Floats:
    """A scaled column of a run log; a channel map that names another column is meant for the other files of the folder."""
    if channel is None or channel.column != name:
        return values
    return values * (1.0 if channel.scale is None else channel.scale) + channel.offset
