"""`stickslip log ...`: look into a log, check it, make a cut one whole, turn it into tables and tables into evidence."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bridge.units import counted
from cockpit.commands.json_option import STDOUT, Json, JsonGroup, carry_out, tell
from cockpit.commands.options import watched_share
from cockpit.run.writable import LOG, TABLE, check_output, check_output_folder

if TYPE_CHECKING:
    from bridge.log.damage import Damage

log_app = typer.Typer(
    cls=JsonGroup, help="Look into a log, check it, make a cut one whole; tables out and in.", no_args_is_help=True
)
LogArgument = Annotated[Path, typer.Argument(help="A run log, .mcap.")]


@log_app.command("info")
def log_info(path: LogArgument, as_json: Json = None) -> None:
    """Judge the run in a log: slips, swing, v_a / v_d, latency, what was lost; exit status 1 where it is not good."""

    def work() -> int:
        from cockpit.judge.verdict import headline, in_words, judge

        verdict = judge(path)
        tell(as_json, verdict.as_dict(), [headline(verdict), *in_words(verdict)])
        return 0 if verdict.good else 1

    carry_out(work, as_json)


@log_app.command("recover")
def log_recover(
    path: LogArgument,
    out: Annotated[Path | None, typer.Option(help="Write here, FILE.mcap, instead of in place.")] = None,
    as_json: Json = None,
) -> None:
    """Save every message that can be read from a cut or damaged log, with a new index."""

    def work() -> None:
        from bridge.log.recover import recover

        if out is not None:
            check_output("--out", out, LOG)
        saved = recover(path, out or path)
        words = f"{out or path}: {counted(saved.messages, 'message')}, whole again; {_lost(saved.damage) or 'nothing was lost'}"
        tell(as_json, {"messages": saved.messages, "out": out or path} | saved.damage._asdict(), [words])

    carry_out(work, as_json)


def _lost(damage: "Damage") -> str:
    """What could not be read, in words; empty when all could."""
    parts = [f"{counted(damage.cut_bytes, 'byte')} of an open chunk at the end"] if damage.cut_bytes else []
    parts += [counted(damage.bad_chunks, "damaged chunk")] if damage.bad_chunks else []
    if damage.bad_records:
        names = "damaged definition, message or stretch", "damaged definitions, messages or stretches"
        parts.append(counted(damage.bad_records, *names))
    parts += ["its end"] if not (parts or damage.whole) else []
    return "lost: " + ", ".join(parts) if parts else ""


@log_app.command("export")
def log_export(
    path: LogArgument,
    to: Annotated[Path, typer.Option("--to", help="FILE.parquet, FILE.csv or FILE.mat.")],
    topic: Annotated[
        str,
        typer.Option(
            "--topic", help="Comma-separated: sensors, applied, command, trace, state, announce; all if not given."
        ),
    ] = "",
    start: Annotated[str, typer.Option("--from", help="From this time of the run on, e.g. 12.5s.")] = "",
    end: Annotated[str, typer.Option("--until", help="Up to this time of the run, e.g. 20s.")] = "",
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace tables that are there.")] = False,
    as_json: Json = None,
) -> None:
    """Write a log as tables, sensors one row a sample, others one row a message; exit status 1: no row, or a damaged log."""

    def work() -> int:
        from bridge.log.logfile import STREAMING
        from bridge.tables.export import export
        from cockpit.run.replay import time_s

        from_s = time_s(f"--from {start}", start, "12.5s") if start else -math.inf
        until_s = time_s(f"--until {end}", end, "20s") if end else math.inf
        check_output("--to", to, TABLE)
        names = [name.strip() for name in topic.split(",")] if topic else STREAMING
        with watched_share(f"exporting {path.name}", quiet=as_json == STDOUT) as progress:
            written = export(path, to, list(dict.fromkeys(names)), from_s, until_s, progress, overwrite)
        words = [f"{name:<8} {counted(rows, 'row')}" for name, rows in written.rows.items()]
        nothing = "nothing to write: no message of these topics in this time; a table that is there stays as it is"
        words += [str(file) for file in written.files] or [nothing]
        lost = _lost(written.damage)
        tell(as_json, written, [*words, f"warning  the log is damaged; {lost}"] if lost else words)
        return 0 if written.files and not lost else 1

    carry_out(work, as_json)


@log_app.command("import")
def log_import(
    path: Annotated[Path, typer.Argument(help="Measured data: .csv, .parquet, .mat (v5 to v7) or .tdms.")],
    channel_map: Annotated[Path, typer.Option("--map", help="Channel map, .toml: columns, scales, rig.")],
    out: Annotated[
        Path,
        typer.Option(
            "--out", help="Evidence folder (a run is added), or FILE.mcap for log check, export and diagnose."
        ),
    ],
    as_json: Json = None,
) -> None:
    """Turn measured data of another program into evidence for `stickslip diagnose`, or into a run log."""

    def work() -> None:
        from diagnosis.evidence.import_table import import_file

        if out.suffix == ".mcap":
            check_output("--out", out, LOG)
        else:
            check_output_folder("--out", out)
        done = import_file(path, channel_map, out)
        place = done.out if done.out.suffix == ".mcap" else done.out / done.file
        words = f"{place}: {counted(done.rows, 'sample')} of {', '.join(done.columns)}"
        tell(as_json, done, [words, *(finding.in_words() for finding in done.findings)])

    carry_out(work, as_json)


@log_app.command("check")
def log_check(path: LogArgument, as_json: Json = None) -> None:
    """Say what is wrong with a log; exit status 0 when nothing is, 1 with findings, 7 when it is no run log."""

    def work() -> int:
        from bridge.log.check.log_check import check_log
        from bridge.log.storage.chain import chain_in_words
        from bridge.wire.topics import BY_NAME

        with watched_share(f"checking {path.name}", quiet=as_json == STDOUT) as progress:
            check = check_log(path, progress)
        counts = ", ".join(
            f"{name} {count}" for name, count in check.messages.items() if count or BY_NAME[name].rate_Hz
        )
        late = ", ".join(f"{name} {100 * share:.2f} %" for name, share in check.late_share.items())
        words = f"{path}: {counted(len(check.findings), 'finding')}; {check.seconds:.2f} s; {counts}; later than 1 ms: {late}"
        tell(as_json, check, [*(finding.in_words() for finding in check.findings), chain_in_words(check.chain), words])
        return 1 if check.findings else 0

    carry_out(work, as_json)
