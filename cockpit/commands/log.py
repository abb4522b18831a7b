"""`stickslip log ...`: look into a log, check it, make a cut one whole, turn it into tables and tables into evidence."""

import json
import math
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cockpit.run.child_process import guarded

if TYPE_CHECKING:
    from bridge.log.logfile import Damage

log_app = typer.Typer(help="Look into a log, check it, make a cut one whole; tables out and in.", no_args_is_help=True)
LogArgument = Annotated[Path, typer.Argument(help="A run log, .mcap.")]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON on stdout.")]


@log_app.command("info")
def log_info(path: LogArgument, as_json: Json = False) -> None:
    """Judge the run in a log: slips, swing, v_a / v_d, latency, what was lost."""

    def work() -> None:
        from cockpit.judge.verdict import headline, in_words, judge

        verdict = judge(path)
        if as_json:
            print(json.dumps(verdict.as_dict()))
        else:
            print("\n".join([headline(verdict), *in_words(verdict)]))

    sys.exit(guarded(work, as_json))


@log_app.command("recover")
def log_recover(
    path: LogArgument,
    out: Annotated[Path | None, typer.Option(help="Write here instead of in place.")] = None,
    as_json: Json = False,
) -> None:
    """Save every message that can be read from a cut or damaged log, with a new index."""

    def work() -> None:
        from bridge.log.logfile import recover

        saved = recover(path, out or path)
        if as_json:
            print(json.dumps({"messages": saved.messages, "out": str(out or path)} | saved.damage._asdict()))
            return
        print(f"{out or path}: {saved.messages} messages, whole again; {_lost(saved.damage) or 'nothing was lost'}")

    sys.exit(guarded(work, as_json))


def _lost(damage: "Damage") -> str:
    """What could not be read, in words; empty when all could."""
    parts = [f"{damage.cut_bytes} bytes of an open chunk at the end"] if damage.cut_bytes else []
    parts += [f"{damage.bad_chunks} damaged chunks"] if damage.bad_chunks else []
    parts += [f"{damage.bad_records} damaged definitions, messages or stretches"] if damage.bad_records else []
    return "lost: " + ", ".join(parts) if parts else ""


@contextmanager
def _progress(text: str, as_json: bool) -> Generator[Callable[[float], None]]:
    """A bar on stderr for a person who watches; yields the function to call with the share done."""
    if as_json or not sys.stderr.isatty():
        yield lambda _share: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(text, total=1.0)
        yield lambda share: bar.update(task, completed=share)


@log_app.command("export")
def log_export(
    path: LogArgument,
    to: Annotated[Path, typer.Option("--to", help="FILE.parquet, FILE.csv or FILE.mat.")],
    topic: Annotated[
        str, typer.Option("--topic", help="Comma-separated: sensors, applied, command, trace, state; all if not given.")
    ] = "",
    start: Annotated[str, typer.Option("--from", help="From this time of the run on, e.g. 12.5s.")] = "",
    end: Annotated[str, typer.Option("--until", help="Up to this time of the run, e.g. 20s.")] = "",
    as_json: Json = False,
) -> None:
    """Write a log as tables: sensors one row a sample, the other topics one row a message."""

    def work() -> None:
        from bridge.log.logfile import STREAMING
        from bridge.tables.export import export
        from cockpit.run.replay import time_s

        from_s = time_s(f"--from {start}", start, "12.5s") if start else -math.inf
        until_s = time_s(f"--until {end}", end, "20s") if end else math.inf
        names = [name.strip() for name in topic.split(",")] if topic else STREAMING
        with _progress(f"exporting {path.name}", as_json) as progress:
            written = export(path, to, list(dict.fromkeys(names)), from_s, until_s, progress)
        files = [str(file) for file in written.files]
        if as_json:
            print(json.dumps({"files": files, "rows": written.rows, "damage": written.damage._asdict()}))
            return
        for name, rows in written.rows.items():
            print(f"{name:<8} {rows} rows")
        print("\n".join(files) or "nothing to write: no message of these topics in this time")
        if lost := _lost(written.damage):
            print(f"warning  the log is damaged; {lost}")

    sys.exit(guarded(work, as_json))


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
    as_json: Json = False,
) -> None:
    """Turn measured data of another program into evidence for `stickslip diagnose`, or into a run log."""

    def work() -> None:
        from diagnosis.evidence.import_table import import_file

        done = import_file(path, channel_map, out)
        if as_json:
            print(json.dumps(done.as_dict()))
            return
        place = done.out if done.out.suffix == ".mcap" else done.out / done.file
        print(f"{place}: {done.rows} samples of {', '.join(done.columns)}")
        for finding in done.findings:
            print(finding.in_words())

    sys.exit(guarded(work, as_json))


@log_app.command("check")
def log_check(path: LogArgument, as_json: Json = False) -> None:
    """Say what is wrong with a log; exit status 0 when nothing is, 1 with findings, 7 when it is no run log."""

    def work() -> int:
        from bridge.log.log_check import check_log

        with _progress(f"checking {path.name}", as_json) as progress:
            check = check_log(path, progress)
        if as_json:
            print(json.dumps(check.as_dict()))
        else:
            for finding in check.findings:
                print(finding.in_words())
            counts = ", ".join(f"{name} {count}" for name, count in check.messages.items())
            late = ", ".join(f"{name} {100 * share:.2f} %" for name, share in check.late_share.items())
            print(f"{path}: {len(check.findings)} findings; {check.seconds:.2f} s; {counts}; later than 1 ms: {late}")
        return 1 if check.findings else 0

    sys.exit(guarded(work, as_json))
