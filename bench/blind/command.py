"""`python -m bench blind ...`: diagnose a set of cases without their sealed answers, then open and score it."""

import time
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from bridge.files import refuse_to_lose
from cockpit.commands.as_json.option import Json, JsonGroup, carry_out, print_result
from cockpit.run.child_process import end_like_ctrl_c
from cockpit.run.writable import PAGE, check_output, writing

if TYPE_CHECKING:
    from bench.blind.opening import OpenedSet

blind_app = typer.Typer(
    cls=JsonGroup,
    help="How good is the diagnosis? Sealed cases, diagnosed without the answers, scored.",
    no_args_is_help=True,
)
SetArgument = Annotated[
    Path, typer.Argument(metavar="DIR", help="A set that `python -m tests.blind make` made, or a folder of sets.")
]
Rival = Annotated[list[str], typer.Option(help="A method of `python -m bench judge` to compare with. Repeatable.")]
Jobs = Annotated[int | None, typer.Option(min=1, help="Processes to use; all cores if not given.")]
Key = Annotated[
    Path, typer.Option(help="The key file, outside DIR; of several sets the folder of their keys, SET.key.")
]
Report = Annotated[Path | None, typer.Option(metavar="FILE", help="Write a report, one .html file.")]


class SetDone(NamedTuple):
    """A set whose every case has a result."""

    folder: str
    diagnosed: int  # number of cases that had no result before


@blind_app.command("run")
def blind_run(folder: SetArgument, rival: Rival = [], jobs: Jobs = None, as_json: Json = None) -> None:  # noqa: B006
    """Diagnose every case that has no result yet, without the key. A stopped run continues with the next call."""

    def work() -> None:
        from joblib import cpu_count

        from bench.blind.opening import sets_of
        from bench.blind.rivals import ask_rivals
        from bench.blind.running import missing, run
        from cockpit.commands.diagnose_output import in_a_line, watched

        end_like_ctrl_c()
        sets = sets_of(folder).values()
        todo = sum(len(missing(path)) for path in sets)
        began = time.monotonic()
        done = 0
        with writing(), watched() as progress:
            for path in sets:
                with closing(run(path, jobs or cpu_count())) as outcomes:
                    for outcome in outcomes:
                        done += 1
                        left_min = (time.monotonic() - began) / done * (todo - done) / 60.0
                        progress(f"{done} of {todo}, {left_min:.0f} min left: {in_a_line(outcome)}", done / todo)
                ask_rivals(path, rival, jobs or cpu_count(), progress)
        words = [f"all cases have results    {folder}", f"next    python -m bench blind score {folder} --key KEY"]
        print_result(as_json, SetDone(str(folder), todo), words)

    carry_out(work, as_json)


@blind_app.command("score")
def blind_score(
    folder: SetArgument,
    key: Key,
    as_json: Json = None,
    report: Report = None,
    rival: Rival = [],  # noqa: B006
    oracle: Annotated[bool, typer.Option("--oracle", help="Ask the oracle too: half a minute a case.")] = False,
    partial: Annotated[bool, typer.Option("--partial", help="Score although results are missing.")] = False,
    jobs: Jobs = None,
) -> None:
    """Check every hash, open the answers, score. Results that change after that count as development data."""

    def work() -> None:
        from joblib import cpu_count

        from bench.blind.opening import compared, open_sets, sets_of
        from bench.judge.methods import known
        from cockpit.commands.diagnose_output import watched

        end_like_ctrl_c()
        known(rival)
        for option, path in (("--json", as_json), ("--report", report)):
            refuse_to_lose([key], "the key", option, path)
        if report is not None:
            check_output("--report", report, PAGE)
        with writing(), watched() as progress:
            sets = open_sets(folder, key, partial)
            for name, path in sets_of(folder).items():
                sets[name] = compared(sets[name], path, rival, oracle, jobs or cpu_count(), progress)
        _told(sets, as_json, report, [])

    carry_out(work, as_json)


@blind_app.command("pool")
def blind_pool(
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE...", help="Files that `blind score --json` wrote, one a set.")
    ],
    as_json: Json = None,
    report: Report = None,
) -> None:
    """Score several opened sets of one version together, or one again, from the files of their scores."""

    def work() -> None:
        from bench.blind.pooling import read_sets

        for option, path in (("--json", as_json), ("--report", report)):
            refuse_to_lose(files, "one of the files to read", option, path)
        if report is not None:
            check_output("--report", report, PAGE)
        _told(read_sets(files), as_json, report, files)

    carry_out(work, as_json)


def _told(sets: "dict[str, OpenedSet]", as_json: Path | None, report: Path | None, files: list[Path]) -> None:
    from bench.blind.opening import scored, together
    from bench.blind.pooling import kept_scores
    from bench.blind.report import write_report
    from bench.blind.table import TOOL, table

    opened_set = together(sets)
    methods = scored(opened_set)
    by_set = {Path(name).stem: scored(part)[TOOL] for name, part in sets.items()}
    with writing():  # before printing, as a closed pipe ends the program there
        if report is not None:
            write_report(methods, by_set, opened_set.sealed, report, files)
    text = table(methods, by_set, opened_set.sealed)
    words = [text, *(["", f"report     {report}"] if report is not None else [])]
    print_result(as_json, kept_scores(opened_set, methods, by_set), words)
