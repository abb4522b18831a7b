"""Import of measured data of other programs, with a channel map, into an evidence folder or a run log of this project."""

from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq
from pydantic import Field, TypeAdapter, ValidationError, model_validator

from bridge.config import Strict, read_toml, validate
from bridge.faults import Fault
from bridge.files import LOG, folder_beside, followed, refuse_to_replace, replacing
from bridge.log.finding import Finding
from bridge.log.runlog import RunLog
from bridge.tables.export import CHANNELS
from bridge.tables.readers import Dialect, Table, read_table
from bridge.units import counted, unit_of
from bridge.wire.messages import sensor_block
from bridge.wire.topics import SENSORS
from diagnosis.evidence.folder import examine
from diagnosis.evidence.manifest import (
    MANIFEST,
    STANDARD,
    ChannelMap,
    DriveVelocity,
    Positive,
    RigTable,
    RunTable,
    check_channel_names,
    read_manifest,
)
from diagnosis.evidence.manifest_text import manifest_text

Floats = npt.NDArray[np.float64]
Columns = dict[str, Floats]
_POSITIVE: TypeAdapter[float] = TypeAdapter(Positive)
_BLOCK_SAMPLES = 20
_IRREGULAR_SHARE = 0.01  # of a step, up to which time counts as even: rounding of a printed column of a DAQ
# Presliding length that is assumed when the map gives no contact stiffness: the paper's steel pair reaches its static force after
# 0.22 um, and other metals after a fraction of a micrometre. Too small: a stiff contact, small steps; too large: soft sticks.
_PRESLIDING_M = 0.22e-6
_ASSUMED_TOLERANCE = 0.3  # relative, of the numbers that follow from it: 3.3 standard deviations reach 0.11 to 2.2 um


class SourceMap(Strict):
    """How the source file is written."""

    sample_rate_Hz: Annotated[float, Field(ge=1.0, le=1e7)] | None = Field(
        default=None, description="Where no column holds the time."
    )
    delimiter: Annotated[str, Field(min_length=1, max_length=1)] = ","
    decimal: Annotated[str, Field(min_length=1, max_length=1)] = "."
    skip_rows: Annotated[int, Field(ge=0)] = 0
    encoding: str = "utf-8"


class RunMap(Strict):
    """Keys of the run that go to the manifest."""

    drive_velocity_mps: DriveVelocity | None = None
    holdout: bool = False


class ImportMap(Strict):
    """A channel map file."""

    source: SourceMap = SourceMap()
    channels: dict[str, ChannelMap]
    rig: dict[str, Any] = Field(default={}, description="As in manifest.toml; only an evidence folder needs it.")
    run: RunMap = RunMap()

    @model_validator(mode="after")
    def _channels_are_enough(self) -> "ImportMap":
        check_channel_names(self.channels)
        if not {"drive_force_N", "mass_accel_mps2"} & self.channels.keys():
            raise ValueError("channels: must name drive_force_N or mass_accel_mps2; nothing shows a slip otherwise")
        if "t_s" in self.channels and self.source.sample_rate_Hz is not None:
            raise ValueError("source.sample_rate_Hz: there is a channel t_s too; remove one of them")
        return self


class Imported(NamedTuple):
    """The result of an import."""

    out: Path  # evidence folder or .mcap file
    file: str  # name of the data file or log that was written
    rows: int
    columns: list[str]
    missing: list[str]  # standard columns that the source does not have
    findings: list[Finding]

    def as_dict(self) -> dict[str, Any]:
        """For `--json`."""
        table = self._asdict() | {"findings": [finding.as_dict() for finding in self.findings]}
        return table | {"out": str(self.out)}


def import_file(path: Path, map_path: Path, out: Path) -> Imported:
    """Import one file; `out` is an evidence folder, to which a run is added, or a .mcap file.

    Raises Fault CONFIG for the map, BAD_TABLE for the file, BAD_EVIDENCE for what is in it, LOG_WRITE. Nothing
    unfinished is left behind.
    """
    wanted = validate(ImportMap, read_toml(map_path), map_path.name)
    source = wanted.source
    table = read_table(path, Dialect(source.delimiter, source.decimal, source.skip_rows, source.encoding))
    columns = _columns(table, wanted, map_path.name)
    try:
        if out.suffix == ".mcap":
            _check_free(out)
            return _to_log(path, columns, out)
        return _to_folder(path, columns, wanted, map_path.name, out)
    except OSError as error:
        raise Fault("LOG_WRITE", f"{out}: {error.strerror or error}; choose another --out") from None


def _check_free(out: Path) -> None:
    """Raise Fault CONFIG when `out` exists: it may be the measured file itself."""
    if out.exists():
        raise Fault("CONFIG", f"{out}: is there already; nothing was written; choose another --out")


def _columns(table: Table, wanted: ImportMap, map_name: str) -> Columns:
    """The standard columns, scaled; time from its column, the map's rate or the file's own."""
    columns: Columns = {}
    for name in STANDARD:
        if name in wanted.channels:
            channel = wanted.channels[name]
            columns[name] = table.column(channel.column) * channel.scale + channel.offset
    if "t_s" not in columns:
        rate_Hz = wanted.source.sample_rate_Hz or table.sample_rate_Hz
        if rate_Hz is None:
            line = f"{map_name}: channels.t_s: missing; name the column of the time, or set source.sample_rate_Hz"
            raise Fault("CONFIG", line)
        rows = len(next(iter(columns.values())))
        columns = {"t_s": np.arange(rows) / rate_Hz} | columns
    for name, values in columns.items():
        if len(values) != len(columns["t_s"]):
            line = (
                f"{table.path.name}: column {wanted.channels[name].column}: {counted(len(values), 'row')}: must have "
                f"{len(columns['t_s'])}, as the time; every channel needs one value a sample"
            )
            raise Fault("BAD_TABLE", line)
    return columns


def _missing(columns: Columns) -> list[str]:
    return [name for name in STANDARD if name not in columns]


def _rig(given: dict[str, Any], map_name: str) -> tuple[RigTable, list[str]]:
    """The rig of the map, with assumed values for numbers that an owner can hardly know; and the names of these numbers."""
    table = dict(given)
    if not table:
        raise Fault("CONFIG", f"{map_name}: rig: missing; an evidence folder needs it, or import into a .mcap file")
    assumed: dict[str, Any] = {"viscous_damping_Ns_per_m": 0.0}
    if table.get("drive") == "spring":
        assumed["drive_damping_Ns_per_m"] = 0.0
    mass_kg, static_N = _positive(table.get("mass_kg")), _positive(table.get("static_force_N"))
    stiffness = _positive(table.get("contact_stiffness_N_per_m", static_N / _PRESLIDING_M))
    assumed["contact_stiffness_N_per_m"] = stiffness
    # critical damping of the presliding motion, as for the paper's pairs
    assumed["contact_damping_Ns_per_m"] = 2.0 * (stiffness * mass_kg) ** 0.5
    filled = [name for name in assumed if name not in table]
    if isinstance(table.get("tolerance", {}), dict):  # any other type is refused by `validate`
        unsure = {name: _ASSUMED_TOLERANCE for name in filled if name.startswith("contact")}
        table["tolerance"] = unsure | table.get("tolerance", {})
    return validate(RigTable, assumed | table, f"{map_name}: rig"), filled


def _positive(value: Any) -> float:
    """The number, or 1 in place of what `validate` refuses: one wrong number must not make others seem to be missing."""
    try:
        return _POSITIVE.validate_python(value, strict=True)
    except ValidationError:
        return 1.0


def _to_folder(path: Path, columns: Columns, wanted: ImportMap, map_name: str, out: Path) -> Imported:
    rig, assumed = _rig(wanted.rig, map_name)
    run = RunTable(file=path.stem + ".parquet", **wanted.run.model_dump())
    runs = [run]
    if (out / MANIFEST).exists():
        before = read_manifest(out)
        if before.rig != rig:
            line = f"{out / MANIFEST}: describes another rig than {map_name}; choose another --out, one folder a rig"
            raise Fault("BAD_EVIDENCE", line)
        if before.channels:
            line = f"{out / MANIFEST}: has [channels], which imported runs must not pass; choose another --out"
            raise Fault("BAD_EVIDENCE", line)
        if path.stem in {other.file.rsplit(".", 1)[0] for other in before.run}:
            line = f"{out / run.file}: is already a run of this folder; rename {path.name} or choose another --out"
            raise Fault("BAD_EVIDENCE", line)
        runs = [*before.run, run]
    elif run.holdout:
        line = (
            f"{map_name}: run.holdout = true: must be false for the first run of a folder, which would have none to fit; "
            "import a run without it first"
        )
        raise Fault("CONFIG", line)
    _check_free(out / run.file)
    # named as the file that is there: run.file is none before it is sound
    findings = examine(columns, rig, run.model_copy(update={"file": path.name}))[1]
    findings += [
        Finding("assumed", f"{MANIFEST}: rig.{name}", f"not in {map_name}: taken as {getattr(rig, name):.6g}")
        for name in assumed
    ]
    created = not out.exists()
    out.mkdir(parents=True, exist_ok=True)
    try:
        fields = [pa.field(name, pa.float64(), nullable=False, metadata={"unit": unit_of(name)}) for name in columns]
        # the manifest takes its place last: it names the table
        with replacing(out / MANIFEST) as manifest, replacing(out / run.file) as file:
            manifest.write(manifest_text(rig, runs, assumed).encode("utf-8"))
            pq.write_table(pa.table(list(columns.values()), schema=pa.schema(fields)), file, use_dictionary=False)
    finally:
        if created and not any(out.iterdir()):
            out.rmdir()
    return Imported(out, run.file, len(columns["t_s"]), list(columns), _missing(columns), findings)


def _to_log(path: Path, columns: Columns, out: Path) -> Imported:
    """Write a log of sensor blocks of 20 samples at the source's own rate; float32, as in every sensor block."""
    findings: list[Finding] = []
    t_s = columns["t_s"]
    if len(t_s) < _BLOCK_SAMPLES or not np.isfinite(t_s).all() or (np.diff(t_s) <= 0).any():
        row = (
            int(np.flatnonzero(~(np.isfinite(t_s) & (np.diff(t_s, prepend=-np.inf) > 0)))[0]) + 1
            if len(t_s) >= _BLOCK_SAMPLES
            else len(t_s)
        )
        line = (
            f"{path.name}: t_s: row {row}: must be later than the row before, in {_BLOCK_SAMPLES} rows at least; "
            "a log has an even clock; repair the file, or import it into a folder"
        )
        raise Fault("BAD_EVIDENCE", line)
    step_s = float(t_s[-1] - t_s[0]) / (len(t_s) - 1)
    even_s = t_s[0] + np.arange(len(t_s)) * step_s
    uneven = float(np.abs(t_s - even_s).max()) / step_s
    if uneven > _IRREGULAR_SHARE:
        columns = columns | {name: np.interp(even_s, t_s, columns[name]) for name in CHANNELS if name in columns}
        text = f"is uneven by up to {uneven:.2g} steps: the channels were interpolated to an even {1.0 / step_s:g} Hz"
        findings.append(Finding("time", f"{path.name}: t_s", text))
    blocks = len(t_s) // _BLOCK_SAMPLES
    if left := len(t_s) - blocks * _BLOCK_SAMPLES:
        text = f"the last {counted(left, 'sample')} left out: too few for a block of {_BLOCK_SAMPLES}"
        findings.append(Finding("cut", path.name, text, left))
    missing = [name for name in CHANNELS if name not in columns]
    findings += [Finding("missing", f"{path.name}: {name}", "not in the source: zeros in the log") for name in missing]
    commanded = [name for name in columns if name.startswith("vibration")]
    text = "left out, as the log holds sensors alone: without it the run counts as one without vibration; import it into a folder"
    findings += [Finding("missing", f"{path.name}: {name}", text) for name in commanded]
    refuse_to_replace(out, LOG, str(out))
    with folder_beside(out) as folder:
        log = RunLog(folder / "import.mcap", lockstep=True)
        about = {"source": path.name, "sample_rate_Hz": 1.0 / step_s, "samples_per_block": _BLOCK_SAMPLES}
        log.add_metadata("import", about | {"missing": missing, "starts_at_s": float(t_s[0]) - step_s})
        message = sensor_block(_BLOCK_SAMPLES).blank()
        for block in range(blocks):
            samples = slice(block * _BLOCK_SAMPLES, (block + 1) * _BLOCK_SAMPLES)
            message["sequence"] = block
            message["t_ns"] = round((block + 1) * _BLOCK_SAMPLES * step_s * 1e9)
            for name in CHANNELS:
                if name in columns:
                    message[name] = columns[name][samples]
            log.write(SENSORS, message.tobytes())
        log.close()
        log.path.replace(followed(out))
    return Imported(
        out, out.name, blocks * _BLOCK_SAMPLES, [name for name in CHANNELS if name in columns], missing, findings
    )
