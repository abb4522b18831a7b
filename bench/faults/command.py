"""`python -m bench faults`: rig and controller under the faults of the catalogue."""

from pathlib import Path
from typing import Annotated

import typer

from bridge.files import write_whole
from cockpit.commands.as_json.option import Json, carry_out, print_result
from cockpit.run.child_process import end_like_ctrl_c
from cockpit.run.writable import check_output, writing


def faults(
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes to use; all cores if not given.")] = None,
    only: Annotated[
        list[str], typer.Option(help="A group of the catalogue, or how the names of faults begin. Repeatable.")
    ] = [],  # noqa: B006
    report: Annotated[Path | None, typer.Option(metavar="FILE", help="Write the table, one .md file.")] = None,
    as_json: Json = None,
) -> None:
    """Inject the faults of deploy/faults and judge by the truth of the rig; exit status 1: a result got worse."""

    def work() -> int:
        from joblib import cpu_count

        from bench.faults.page import page
        from bench.faults.run import bench, chosen
        from cockpit.commands.diagnose_output import watched
        from cockpit.faults.catalogue import load_catalogue

        end_like_ctrl_c()
        if report is not None:
            check_output("--report", report, (".md",))
        wanted = chosen(load_catalogue(), only)
        with watched() as progress:
            result = bench(wanted, jobs or cpu_count(), lambda share, line: progress(line, share))
        if report is not None:
            with writing(report):
                write_whole(report, page(result))
        print_result(as_json, result, [*result.in_words(), *([f"report   {report}"] if report else [])], indent=1)
        return 1 if result.worse else 0

    carry_out(work, as_json)
