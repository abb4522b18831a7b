"""`stickslip log ...`: judge, check, recover and export a log; import measured tables as evidence."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bridge.faults import Fault
from bridge.units import counted
from cockpit.commands.as_json.option import STDOUT, Json, JsonGroup, print_result
from cockpit.commands.options import FILE, FileOptions, Strict, Verbose, command, watched_share
from cockpit.run.child_process import ReportedFault
from cockpit.run.writable import LOG, TABLE, check_output, check_output_folder

if TYPE_CHECKING:
    from cockpit.judge.judged import Judged
    from cockpit.look.source import LookOptions
    from diagnosis.evidence.import_table import Imported

log_app = typer.Typer(
    cls=JsonGroup,
    help="Judge, check and recover a log; export it as tables; import measured tables.",
    no_args_is_help=True,
)
LogArgument = Annotated[Path, typer.Argument(help="A run log, .mcap.")]
_WORST_FIRST = (7, 1, 14, 0)  # exit statuses: no log, not ok, not judged, ok


@log_app.command("info")
@command()
def log_info(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help="Run logs, .mcap; for several a line each.")],
    verbose: Verbose = False,
    strict: Strict = False,
    as_json: Json = None,
) -> int:
    """Judge the run in a log, and check the log; exit status 0 ok, 1 not ok, 14 not judged, 7 no log; of several the worst."""
    quiet = as_json == STDOUT
    if len(logs) == 1:
        judged = _judged(logs[0], quiet)
        print_result(as_json, judged, _in_words(judged, verbose, strict))
        return judged.verdict.exit_status(strict)
    rows = [_row(path, quiet, strict) for path in logs]
    print_result(as_json, [result for _, _, result in rows], [line for _, line, _ in rows])
    return min((status for status, _, _ in rows), key=_WORST_FIRST.index)


def _judged(path: Path, quiet: bool) -> "Judged":
    from cockpit.judge.judged import judge_log

    with watched_share(f"judging {path.name}", quiet=quiet) as progress:
        return judge_log(path, progress)


def _row(path: Path, quiet: bool, strict: bool) -> "tuple[int, str, Judged | ReportedFault]":
    """Exit status, line and result of one log of several; a file that is not a log does not end the work on the others."""
    try:
        judged = _judged(path, quiet)
    except Fault as fault:
        if fault.kind.code != "BAD_LOG":
            raise
        status = fault.kind.exit_status
        return status, f"{'no log':<10} {fault.line}", ReportedFault(fault.kind.code, fault.line, status)
    verdict = judged.verdict
    line = f"{verdict.control:<10} {path}: {verdict.headline.removeprefix(f'{verdict.control}: ')}"
    return verdict.exit_status(strict), line, judged


def _in_words(judged: "Judged", verbose: bool, strict: bool) -> list[str]:
    from cockpit.judge.verdict_words import in_words, shortened, strictly

    verdict = judged.verdict
    known = {line.partition(":")[0].lower().replace("_", "-") for line in (*verdict.faults, *verdict.told)}
    findings = [f"finding  {finding.in_words()}" for finding in judged.findings if finding.kind not in known]
    return [*in_words(verdict, verbose), *shortened(findings, verbose), *strictly(verdict, strict)]


@log_app.command("recover")
@command()
def log_recover(
    path: LogArgument,
    out: Annotated[Path | None, typer.Option(help="Log to write; LOG.recovered.mcap if not given.")] = None,
    in_place: Annotated[
        bool, typer.Option("--in-place", help="Replace the log itself, with all of its files.")
    ] = False,
    as_json: Json = None,
) -> None:
    """Copy every readable message of a cut or damaged log to a new file with an index; the topics are unchanged."""
    from bridge.files import check_file, same_file
    from bridge.log.damage import lost_in_words
    from bridge.log.recover import recover
    from bridge.log.storage.parts import parts_of

    if out is not None and in_place:
        raise Fault("CONFIG", f"--out {out}: cannot go with --in-place; give one of the two")
    new = path if in_place else out or path.with_name(f"{path.stem}.recovered.mcap")
    if out is not None:
        check_output("--out", out, LOG)
    check_file(path, "BAD_LOG", "give the path of a run log, .mcap")
    if not in_place and any(same_file(new, part) for part in parts_of(path)):
        line = (
            f"--out {new}: is a file of the log and would be replaced; use --in-place to replace it, or choose another"
        )
        raise Fault("CONFIG", line)
    check_output("--in-place" if in_place else "--out", new, LOG)
    saved = recover(path, new)
    how = "in place" if in_place else "in a new file"
    parts = [f"{new}: {counted(saved.messages, 'message')}, {how} with an index"]
    if saved.attachments:
        parts.append(counted(saved.attachments, "attachment left out", "attachments left out"))
    lost = lost_in_words(saved.damage)
    parts.append(f"lost: {lost}" if lost else "every message of the log is in it")
    if saved.damage.before:
        parts.append(f"do not trust it: {saved.damage.before}")
    print_result(as_json, saved, ["; ".join(parts)])


@log_app.command("export")
@command()
def log_export(
    path: LogArgument,
    to: Annotated[Path, typer.Option("--to", help="Table to write: FILE.parquet, FILE.csv or FILE.mat.")],
    topic: Annotated[
        str,
        typer.Option(
            "--topic",
            help="Topics, comma-separated: sensors, applied, command, trace, state, announce; all if not given.",
        ),
    ] = "",
    start: Annotated[str, typer.Option("--from", help="Start time in the run, e.g. 12.5s.")] = "",
    end: Annotated[str, typer.Option("--until", help="End time in the run, e.g. 20s.")] = "",
    raw: Annotated[
        bool, typer.Option("--raw", help="Sensors also in units of the device, by the calibration in the log.")
    ] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace existing tables.")] = False,
    as_json: Json = None,
) -> int:
    """Write a log as tables: sensors one row per sample, others one row per message; exit status 1: no row, or a damaged log."""
    from bridge.log.damage import lost_in_words
    from bridge.log.logfile import STREAMING
    from bridge.tables.export import export
    from cockpit.run.replay import time_s

    from_s = time_s(f"--from {start}", start, "12.5s") if start else -math.inf
    until_s = time_s(f"--until {end}", end, "20s") if end else math.inf
    check_output("--to", to, TABLE)
    names = [name.strip() for name in topic.split(",")] if topic else STREAMING
    with watched_share(f"exporting {path.name}", quiet=as_json == STDOUT) as progress:
        written = export(path, to, list(dict.fromkeys(names)), from_s, until_s, progress, overwrite, raw)
    words = [f"{name:<8} {counted(rows, 'row')}" for name, rows in written.rows.items()]
    nothing = "nothing written: no message of these topics in this time; an existing table is unchanged"
    words += [str(file) for file in written.files] or [nothing]
    lost = lost_in_words(written.damage)
    words += [f"warning  the log is damaged; lost: {lost}"] if lost else []
    before = written.damage.before
    words += [f"warning  the log was recovered from a damaged log: {before}"] if before else []
    print_result(as_json, written, words)
    return 0 if written.files and not lost else 1


@log_app.command("import")
@command(*FILE)
def log_import(
    options: FileOptions,
    path: Annotated[
        Path,
        typer.Argument(help="Measured data: text with any delimiter, .xlsx, .parquet, .mat, .h5, .tdms, .json, .mcap."),
    ],
    out: Annotated[
        Path,
        typer.Option(
            "--out", help="Evidence folder, to which a run is added, or FILE.mcap for log check, export and diagnose."
        ),
    ],
    as_json: Json = None,
) -> None:
    """Convert measured data of another program to evidence for `stickslip diagnose`, or to a run log; without --map by names."""
    from bridge.config import read_toml, validate
    from cockpit.look.source import overridden
    from diagnosis.evidence.import_table import ImportMap, import_by_map

    if out.suffix == ".mcap":
        check_output("--out", out, LOG)
    else:
        check_output_folder("--out", out)
    asked, kept = options.asked(), None
    if asked.map is not None:
        wanted = overridden(validate(ImportMap, read_toml(asked.map), asked.map.name), asked)
        done = import_by_map(path, wanted, asked.map.name, out, asked.piece)
    else:
        stem = out.with_suffix("") if out.suffix == ".mcap" else out / path.stem
        kept = stem.with_name(stem.name + ".map.toml")
        done = _import_as_seen(path, out, kept, asked)
    folder = done.out.parent if done.out.suffix == ".mcap" else done.out
    places = ", ".join(str(folder / file) for file in done.files)
    words = [f"{places}: {counted(done.rows, 'sample')} of {', '.join(done.columns)}"]
    words += [finding.in_words() for finding in done.findings]
    if kept is not None:
        words.append(f"map        {kept} holds the assumptions; correct it, then give it to --map with a new --out")
    print_result(as_json, done, words)


def _import_as_seen(path: Path, out: Path, kept: Path, asked: "LookOptions") -> "Imported":
    """Import without a map: columns by their names, numbers of the rig from the record; write the resulting map to `kept`."""
    import tomllib

    from bridge.config import validate
    from bridge.files import refuse_to_replace_corrected, write_whole
    from cockpit.look.doubts import refuse_absurd
    from cockpit.look.evidence import columns_of, full_map
    from cockpit.look.source import looked_at, read_record
    from diagnosis.evidence.import_table import ImportMap, import_columns
    from diagnosis.evidence.mapped import Mapped

    record = read_record(path, asked._replace(piece=None))
    if record.known.unit:
        line = f"{path.name}: holds no force but a number in {record.known.unit}: a log needs a force"
        raise Fault("CONFIG", f"{line}; `stickslip look` reads it, and a map with scale = ... makes a force of it")
    if not record.map_text:
        raise Fault("CONFIG", f"{path.name}: is a run log of this project; use it without import")
    seen = looked_at(record)
    refuse_absurd(seen, path.name, record.counts)
    made = record.map_text if out.suffix == ".mcap" else full_map(record, seen)
    refuse_to_replace_corrected(kept, made, str(kept))
    wanted = validate(ImportMap, tomllib.loads(made), kept.name)
    read = Mapped(columns_of(record), record.findings, record.starts_s)
    done = import_columns(path, read, wanted, kept.name, out, asked.piece)
    write_whole(kept, made)
    return done


@log_app.command("check")
@command()
def log_check(path: LogArgument, as_json: Json = None) -> int:
    """Print the findings of a log, for scripts; exit status 0: none, 1: findings, 7: not a run log."""
    from bridge.log.check.log_check import check_log
    from bridge.log.damage import foreign_in_words
    from bridge.log.storage.checksums import checksums_in_words
    from bridge.wire.topics import BY_NAME

    with watched_share(f"checking {path.name}", quiet=as_json == STDOUT) as progress:
        check = check_log(path, progress)
    counts = ", ".join(f"{name} {count}" for name, count in check.messages.items() if count or BY_NAME[name].rate_Hz)
    late = ", ".join(f"{name} {100 * share:.2f} %" for name, share in check.late_share.items())
    words = (
        f"{path}: {counted(len(check.findings), 'finding')}; {check.seconds:.2f} s; {counts}; later than 1 ms: {late}"
    )
    findings = [finding.in_words() for finding in check.findings]
    others = [f"others   {line}" for line in foreign_in_words(check.foreign)]
    print_result(as_json, check, [*findings, checksums_in_words(check.checksums), *others, words])
    return 1 if check.findings else 0
