"""`stickslip blind ...`: diagnose a set of rigs with sealed answers without them, open and score it."""

import sys
import time
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bridge.faults import Fault
from cockpit.run.child_process import end_like_ctrl_c, guarded
from cockpit.run.writable import check_writable, writing

if TYPE_CHECKING:
    from diagnosis.blind.opening import OpenedSet

blind_app = typer.Typer(
    help="How good is the diagnosis? Sealed cases, diagnosed without the answers, scored.", no_args_is_help=True
)
SetArgument = Annotated[Path, typer.Argument(metavar="DIR", help="A set that `python -m tests.blind make` made.")]
Jobs = Annotated[int | None, typer.Option(min=1, help="Processes to use; all cores if not given.")]
Key = Annotated[Path, typer.Option(help="The key file with the answers, outside DIR.")]
AsJson = Annotated[
    Path | None,
    typer.Option(
        "--json",
        metavar="FILE",
        help="Write the scores here as JSON, with what is there and what was said of every case.",
    ),
]
Report = Annotated[Path | None, typer.Option(metavar="FILE", help="Write a report, one HTML file.")]


_LEFT_TO_THE_COMMAND = {"allow_extra_args": True, "ignore_unknown_options": True}


@blind_app.command("make", hidden=True, add_help_option=False, context_settings=_LEFT_TO_THE_COMMAND)
def blind_make() -> None:
    """Say which command makes a set: the generators of cases are part of the tests, which are not installed."""

    def work() -> None:
        line = (
            "blind make: is not part of stickslip; in a checkout of the source tree, write python -m tests.blind make"
        )
        raise Fault("CONFIG", line)

    sys.exit(guarded(work))


@blind_app.command("run")
def blind_run(folder: SetArgument, jobs: Jobs = None) -> None:
    """Diagnose every case that has no result yet, without the key. It can be stopped and taken up again."""

    def work() -> None:
        from joblib import cpu_count

        from cockpit.commands.diagnose_output import in_a_line, watched
        from diagnosis.blind.running import missing, run

        end_like_ctrl_c()
        todo = len(missing(folder))
        began = time.monotonic()
        with writing(), watched() as progress, closing(run(folder, jobs or cpu_count())) as outcomes:
            for done, outcome in enumerate(outcomes, 1):
                left_min = (time.monotonic() - began) / done * (todo - done) / 60.0
                progress(f"{done} of {todo}, {left_min:.0f} min left: {in_a_line(outcome)}", done / todo)
        print(f"all cases have results    {folder}\nnext    stickslip blind score {folder} --key KEY")

    sys.exit(guarded(work))


@blind_app.command("score")
def blind_score(
    folder: SetArgument,
    key: Key,
    as_json: AsJson = None,
    report: Report = None,
    baselines: Annotated[
        bool, typer.Option("--baselines", help="Oracle and tree ensemble too: half a minute a case and core.")
    ] = False,
    partial: Annotated[bool, typer.Option("--partial", help="Score although results are missing.")] = False,
    jobs: Jobs = None,
) -> None:
    """Check every hash, open the answers, score. A set that was opened once is development data from then on."""

    def work() -> None:
        from joblib import cpu_count

        from cockpit.commands.diagnose_output import watched
        from diagnosis.blind.opening import open_set, with_baselines

        end_like_ctrl_c()
        _check_file("--json", as_json)
        _check_file("--report", report)
        with writing(), watched() as progress:
            found = open_set(folder, key, partial)
            if baselines:
                found = with_baselines(found, folder, jobs or cpu_count(), progress)
        _told(found, folder.name, as_json, report)

    sys.exit(guarded(work))


@blind_app.command("pool")
def blind_pool(
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE...", help="What `blind score --json` wrote of each set.")
    ],
    as_json: AsJson = None,
    report: Report = None,
) -> None:
    """Score several opened sets of one version together, or one again, from the files of their scores."""

    def work() -> None:
        from diagnosis.blind.pooling import pooled

        for option, path in (("--json", as_json), ("--report", report)):
            _check_file(option, path)
            if path is not None and path.resolve() in {file.resolve() for file in files}:
                raise Fault(
                    "CONFIG", f"{option} {path}: is one of the files to read, which would be lost; choose another"
                )
        _told(pooled(files), ", ".join(path.stem for path in files), as_json, report)

    sys.exit(guarded(work))


def _told(found: "OpenedSet", name: str, as_json: Path | None, report: Path | None) -> None:
    from diagnosis.blind.opening import scored
    from diagnosis.blind.pooling import write_scores
    from diagnosis.blind.report import write_report
    from diagnosis.blind.table import table

    methods = scored(found)
    with writing():  # before anything is printed, which ends where nobody reads on
        if as_json is not None:
            write_scores(as_json, found, methods)
        if report is not None:
            write_report(methods, found.sealed, name, report)
    print(table(methods, found.sealed))
    if report is not None:
        print(f"\nreport     {report}")


def _check_file(option: str, path: Path | None) -> None:
    """Refuse before the answers are opened what could not be written afterwards. Raises Fault."""
    if path is None:
        return
    check_writable(option, path)
    if path.is_dir():
        raise Fault("CONFIG", f"{option} {path}: must be a file, not a folder; choose another")
