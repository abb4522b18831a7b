"""Import of data of other programs, by a channel map, into an evidence folder or a run log of this project."""

import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq
from pydantic import Field, model_validator

from bridge.arrays import Floats
from bridge.config import Strict, read_toml, validate
from bridge.faults import Fault
from bridge.files import LOG, folder_beside, followed, refuse_to_replace, replacing
from bridge.log.finding import Finding
from bridge.log.runlog import RunLog
from bridge.log.storage.verdict_file import remove_verdict
from bridge.tables.export import CHANNELS
from bridge.tables.one_clock import gaps_of
from bridge.tables.readers import read_table
from bridge.tables.unit_words import known_unit
from bridge.units import counted, unit_of
from bridge.wire.messages import sensor_block
from bridge.wire.topics import SENSORS
from diagnosis.evidence.assumed import with_assumed
from diagnosis.evidence.column_checks import WRONG_SIGN
from diagnosis.evidence.conversion import with_beside
from diagnosis.evidence.folder import examine
from diagnosis.evidence.manifest import MANIFEST, DriveVelocity, RigTable, RunTable, manifest_text, read_manifest
from diagnosis.evidence.manifest_keys import USUAL, ChannelMap, Columns, SourceMap, check_channel_names, with_numbers
from diagnosis.evidence.mapped import Mapped, mapped, piece_of
from diagnosis.evidence.unknown_mass import shown_mass_kg

_AGAINST = 0.3  # share of all work that the drive receives, from which the sign is wrong; a loaded spring returns some
_BLOCK_SAMPLES = 20
_IRREGULAR_SHARE = 0.01  # deviation from an even clock, in steps, that counts as even: rounding of printed times


class RunMap(Strict):
    """Keys of the run that go to the manifest."""

    drive_velocity_mps: DriveVelocity | None = None
    holdout: bool = False


class ImportMap(Strict):
    """A channel map file."""

    source: SourceMap = SourceMap()
    channels: dict[str, ChannelMap]
    numbers: dict[str, float] = Field(default={}, description="Numbers by name, for the formulas of derived channels.")
    rig: dict[str, Any] = Field(default={}, description="[rig] of manifest.toml; only an evidence folder needs it.")
    run: RunMap = RunMap()

    @model_validator(mode="after")
    def _channels_are_enough(self) -> "ImportMap":
        check_channel_names(self.channels)
        self.channels.update(with_numbers(self.channels, self.numbers))
        if not {"drive_force_N", "mass_accel_mps2", "motor_current_A"} & self.channels.keys():
            raise ValueError("channels: must name drive_force_N or mass_accel_mps2; no other column shows a slip")
        if "t_s" in self.channels and self.source.sample_rate_Hz is not None:
            raise ValueError("source.sample_rate_Hz: there is a channel t_s too; remove one of them")
        return self


class Imported(NamedTuple):
    """The result of an import."""

    out: Path  # evidence folder or .mcap file
    file: str  # name of the written data file or log
    rows: int
    columns: list[str]
    missing: list[str]  # standard columns that the source does not have
    findings: list[Finding]
    files: list[str]  # names of all written files: one for each piece of a file whose time begins again


def import_file(path: Path, map_path: Path, out: Path) -> Imported:
    """Import one file by a map; see `import_columns`."""
    return import_by_map(path, validate(ImportMap, read_toml(map_path), map_path.name), map_path.name, out)


def import_by_map(path: Path, wanted: ImportMap, map_name: str, out: Path, piece: int | None = None) -> Imported:
    """Import one file, or one piece of it, by a map; see `import_columns`."""
    table = read_table(path, wanted.source.dialect, wanted.source.format)
    rotary = wanted.rig["drive"] == "torsion" if "drive" in wanted.rig else None
    read = mapped(table, wanted.channels, wanted.source.sample_rate_Hz, rotary)
    if "drive_force_N" in wanted.channels and not wanted.channels["drive_force_N"].unit:
        channel = wanted.channels["drive_force_N"]
        unit = table.unit(channel.column) if channel.scale is None else ""
        known = {"drive_force_N": channel.model_copy(update={"unit": unit if known_unit(unit) else ""})}
        wanted = wanted.model_copy(update={"channels": wanted.channels | known})
    return import_columns(path, read, wanted, map_name, out, piece)


def import_columns(
    path: Path, read: Mapped, wanted: ImportMap, map_name: str, out: Path, piece: int | None = None
) -> Imported:
    """Import the columns of a file; `out` is an evidence folder, to which a run is added, or a .mcap file.

    A file whose time begins again becomes a run for each piece, `NAME-1`, `NAME-2`, ..., or the run of `piece` alone.

    Raises Fault CONFIG for the map, BAD_TABLE for the file, BAD_EVIDENCE for its content, LOG_WRITE. Nothing
    unfinished is left behind.
    """
    count = max(len(read.starts_s), 1)
    done: list[Imported] = []
    findings, refused = list(read.findings), list[Fault]()
    for number in range(1, count + 1) if piece is None else [piece]:
        inside = piece_of(read.columns["t_s"], read.starts_s, number, path.name)
        columns, name, target = read.columns, path, out
        if count > 1:
            columns = {key: values[inside] for key, values in columns.items()}
            name = path.with_name(f"{path.stem}-{number}{path.suffix}")
            target = out.with_name(f"{out.stem}-{number}.mcap") if out.suffix == ".mcap" else out
        try:
            written = _written(name, columns, wanted, map_name, target)
        except Fault as fault:
            if count < 2:
                raise
            refused.append(fault)
            findings.append(Finding("pieces", f"{path.name}: piece {number}", f"left out: {fault.line}"))
            continue
        done.append(written)
        findings += [
            finding for finding in _with_sign(written.findings, name.name, columns, wanted) if finding not in findings
        ]
    if not done:
        raise refused[0]
    rows, files = sum(part.rows for part in done), [part.file for part in done]
    return done[0]._replace(rows=rows, findings=findings, files=files)


def _written(path: Path, columns: Columns, wanted: ImportMap, map_name: str, out: Path) -> Imported:
    try:
        if out.suffix == ".mcap":
            _check_free(out)
            return _to_log(path, columns, out)
        return _to_folder(path, columns, wanted, map_name, out)
    except OSError as error:
        raise Fault("LOG_WRITE", f"{out}: {error.strerror or error}; choose another --out") from None


def _with_sign(findings: list[Finding], file: str, columns: Columns, wanted: ImportMap) -> list[Finding]:
    """The findings, with a line to copy where the force has the wrong sign."""
    kept = [
        finding for finding in findings if finding.kind != WRONG_SIGN or not finding.where.endswith("drive_force_N")
    ]
    if len(kept) == len(findings) and not _pulls_back(columns):
        return findings
    channel = wanted.channels["drive_force_N"]
    known = known_unit(channel.unit)
    scale = channel.scale if channel.scale is not None else known[1] if known is not None else 1.0
    offset = f", offset = {-channel.offset!r}" if channel.offset else ""
    line = (
        f"drive_force_N = {{ column = {json.dumps(channel.column, ensure_ascii=False)}, scale = {-scale!r}{offset} }}"
    )
    text = "pulls against the drive's motion: its sign is wrong, and a diagnosis leaves it out; under [channels] write"
    return [*kept, Finding(WRONG_SIGN, f"{file}: drive_force_N", f"{text} {line}")]


def _pulls_back(columns: Columns) -> bool:
    """Whether the drive receives work over the run. Friction returns no work, so the sign is wrong on every rig."""
    if not {"drive_force_N", "drive_position_m"} <= columns.keys():
        return False
    work_J = np.nan_to_num(columns["drive_force_N"][1:] * np.diff(columns["drive_position_m"]))
    return float(work_J.sum()) < -_AGAINST * float(np.abs(work_J).sum())


def _check_free(out: Path) -> None:
    """Raise Fault CONFIG when `out` exists: it may be the measured file itself."""
    if out.exists():
        raise Fault("CONFIG", f"{out}: exists already; nothing was written; choose another --out")


def _rig(given: dict[str, Any], map_name: str, mass_kg: float | None = None) -> tuple[RigTable, list[str]]:
    """The rig of the map, with assumed values for missing numbers that few owners know; and the names of these numbers."""
    if not given:
        raise Fault("CONFIG", f"{map_name}: rig: missing; an evidence folder needs it, or import into a .mcap file")
    table, filled = with_assumed(given, mass_kg)
    return validate(RigTable, table, f"{map_name}: rig"), filled


def _to_folder(path: Path, columns: Columns, wanted: ImportMap, map_name: str, out: Path) -> Imported:
    rig, assumed = _rig(wanted.rig, map_name)
    run = RunTable(file=path.stem + ".parquet", **wanted.run.model_dump())
    if "mass_kg" in assumed and (seen_kg := shown_mass_kg(rig, run, with_beside(columns, rig, run)[0])) is not None:
        rig, assumed = _rig(wanted.rig, map_name, seen_kg)
    runs = [run]
    if (out / MANIFEST).exists():
        before = read_manifest(out)
        if before.rig != rig:
            line = f"{out / MANIFEST}: describes another rig than {map_name}; choose another --out, one folder a rig"
            raise Fault("BAD_EVIDENCE", line)
        if before.channels:
            line = f"{out / MANIFEST}: has [channels], which must not apply to imported runs; choose another --out"
            raise Fault("BAD_EVIDENCE", line)
        if path.stem in {earlier.file.rsplit(".", 1)[0] for earlier in before.run}:
            line = f"{out / run.file}: is already a run of this folder; rename {path.name} or choose another --out"
            raise Fault("BAD_EVIDENCE", line)
        runs = [*before.run, run]
    elif run.holdout:
        line = (
            f"{map_name}: run.holdout = true: must be false for the first run of a folder, which needs a run to fit; "
            "import a run without holdout first"
        )
        raise Fault("CONFIG", line)
    _check_free(out / run.file)
    # named after the source file: run.file does not exist before the check passes
    findings = examine(columns, rig, run.model_copy(update={"file": path.name}))[1]
    findings += [
        Finding("assumed", f"{MANIFEST}: rig.{name}", f"not in {map_name}: taken as {getattr(rig, name):.6g}")
        for name in assumed
    ]
    created = not out.exists()
    out.mkdir(parents=True, exist_ok=True)
    try:
        write_run(out, columns, rig, runs, assumed)
    finally:
        if created and not any(out.iterdir()):
            out.rmdir()
    missing = [name for name in USUAL if name not in columns]
    return Imported(out, run.file, len(columns["t_s"]), list(columns), missing, findings, [run.file])


def write_run(folder: Path, columns: Columns, rig: RigTable, runs: list[RunTable], assumed: list[str]) -> None:
    """Write the data file of the last of `runs` and the manifest of all."""
    fields = [pa.field(name, pa.float64(), nullable=False, metadata={"unit": unit_of(name)}) for name in columns]
    # the manifest is replaced last, as it names the data file
    with replacing(folder / MANIFEST) as manifest, replacing(folder / runs[-1].file) as file:
        manifest.write(manifest_text(rig, runs, assumed).encode("utf-8"))
        pq.write_table(pa.table(list(columns.values()), schema=pa.schema(fields)), file, use_dictionary=False)


def _even_clock(t_s: Floats, file: str) -> tuple[Floats, float, npt.NDArray[np.bool_], list[Finding]]:
    """An even clock over the times [rows]: its instants [samples], its step, which instants lie in a gap, and findings.

    Gaps are not interpolated: the log lacks these blocks, as if a recorder had lost them.
    """
    gaps, gap_text = gaps_of(t_s)
    where = f"{file}: t_s"
    if not len(gaps):
        step_s = float(t_s[-1] - t_s[0]) / (len(t_s) - 1)
        even_s = t_s[0] + np.arange(len(t_s)) * step_s
        uneven = float(np.abs(t_s - even_s).max()) / step_s
        text = f"is uneven by up to {uneven:.2g} steps: the channels were interpolated to an even {1.0 / step_s:g} Hz"
        notes = [Finding("time", where, text)] if uneven > _IRREGULAR_SHARE else []
        return even_s, step_s, np.zeros(len(t_s), np.bool_), notes
    step_s = float(np.delete(np.diff(t_s), gaps).mean())
    even_s = t_s[0] + np.arange(int(float(t_s[-1] - t_s[0]) / step_s) + 1) * step_s
    before = np.clip(np.searchsorted(t_s, even_s, side="right") - 1, 0, len(t_s) - 2)
    in_gap = np.isin(before, gaps) & (even_s > t_s[before] + 0.5 * step_s)
    text = f"{gap_text}: the log has no block there; the rest is on an even clock of {1.0 / step_s:g} Hz"
    return even_s, step_s, in_gap, [Finding("time-gap", where, text, len(gaps))]


def _to_log(path: Path, columns: Columns, out: Path) -> Imported:
    """Write a log of sensor blocks of 20 samples at the source's own rate; float32, as in every sensor block."""
    findings: list[Finding] = []
    known = np.isfinite(columns["t_s"])
    if without := int((~known).sum()):
        text = f"{counted(without, 'row')} without a time left out, first row {int(np.argmin(known)) + 1}"
        findings.append(Finding("not-finite", f"{path.name}: t_s", text, without))
    columns = columns if known.all() else {name: values[known] for name, values in columns.items()}
    t_s = columns["t_s"]
    if len(t_s) < _BLOCK_SAMPLES or not np.isfinite(t_s).all() or (np.diff(t_s) <= 0).any():
        row = (
            int(np.flatnonzero(~(np.isfinite(t_s) & (np.diff(t_s, prepend=-np.inf) > 0)))[0]) + 1
            if len(t_s) >= _BLOCK_SAMPLES
            else len(t_s)
        )
        line = (
            f"{path.name}: t_s: row {row}: must be later than the row before, and a log needs {_BLOCK_SAMPLES} rows at least; "
            "repair the file, or import it into a folder"
        )
        raise Fault("BAD_EVIDENCE", line)
    even_s, step_s, in_gap, notes = _even_clock(t_s, path.name)
    findings += notes
    if len(even_s) != len(t_s) or float(np.abs(t_s - even_s).max()) > _IRREGULAR_SHARE * step_s:
        columns = columns | {name: np.interp(even_s, t_s, columns[name]) for name in CHANNELS if name in columns}
    blocks = len(even_s) // _BLOCK_SAMPLES
    if left := len(even_s) - blocks * _BLOCK_SAMPLES:
        text = f"the last {counted(left, 'sample')} left out: too few for a block of {_BLOCK_SAMPLES}"
        findings.append(Finding("cut", path.name, text, left))
    lacking = in_gap[: blocks * _BLOCK_SAMPLES].reshape(-1, _BLOCK_SAMPLES).any(axis=1)
    missing = [name for name in CHANNELS if name not in columns]
    findings += [
        Finding("missing", f"{path.name}: {name}", "not in the source: no numbers in the log") for name in missing
    ]
    commanded = [name for name in columns if name.startswith("vibration")]
    text = "left out: a log holds sensors alone, and the run counts as a run without vibration; import it into a folder"
    findings += [Finding("missing", f"{path.name}: {name}", text) for name in commanded]
    refuse_to_replace(out, LOG, str(out))
    with folder_beside(out) as folder:
        log = RunLog(folder / "import.mcap", lockstep=True)
        about = {"source": path.name, "sample_rate_Hz": 1.0 / step_s, "samples_per_block": _BLOCK_SAMPLES}
        log.add_metadata("import", about | {"missing": missing, "starts_at_s": float(t_s[0]) - step_s})
        message = sensor_block(_BLOCK_SAMPLES).blank()
        for name in missing:
            message[name] = np.nan
        for block in np.flatnonzero(~lacking).tolist():
            samples = slice(block * _BLOCK_SAMPLES, (block + 1) * _BLOCK_SAMPLES)
            message["sequence"] = block
            message["t_ns"] = round((block + 1) * _BLOCK_SAMPLES * step_s * 1e9)
            for name in CHANNELS:
                if name in columns:
                    message[name] = columns[name][samples]
            log.write(SENSORS, message.tobytes())
        log.close()
        log.path.replace(followed(out))
    remove_verdict(out)
    logged = [name for name in CHANNELS if name in columns]
    return Imported(out, out.name, int((~lacking).sum()) * _BLOCK_SAMPLES, logged, missing, findings, [out.name])
