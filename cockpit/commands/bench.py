"""`stickslip bench control`: the controller on the scenarios of the bank, beside rules that need no controller."""

from pathlib import Path
from typing import Annotated

import typer

from cockpit.commands.json_option import Json, JsonGroup, carry_out, tell
from cockpit.run.child_process import end_like_ctrl_c
from cockpit.run.writable import PAGE, check_output, writing

bench_app = typer.Typer(
    cls=JsonGroup, help="How good is the controller? Judged by what truly happens on made rigs.", no_args_is_help=True
)


@bench_app.callback()
def _about() -> None:
    """Keep `control` a word of its own."""


@bench_app.command("control")
def bench_control(
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes to use; all cores if not given.")] = None,
    only: Annotated[
        list[str], typer.Option(help="A family of the bank, or how the names of scenarios begin. Repeatable.")
    ] = [],  # noqa: B006
    small: Annotated[bool, typer.Option("--small", help="The small part of the bank alone, some seconds.")] = False,
    rivals: Annotated[bool, typer.Option(help="Run the rules that need no controller, too.")] = True,
    report: Annotated[Path | None, typer.Option(metavar="FILE", help="Write a report, one .html file.")] = None,
    as_json: Json = None,
) -> None:
    """Run the controller on the bank, and judge it by the plant's truth; exit status 3: it misses a bar."""

    def work() -> int:
        from joblib import cpu_count

        from cockpit.bank.result import bench, in_words
        from cockpit.bank.scenario import chosen, load_bank
        from cockpit.commands.diagnose_output import watched

        end_like_ctrl_c()
        if report is not None:
            check_output("--report", report, PAGE)
        bank = chosen(load_bank(), only, small)
        with watched() as progress:
            result = bench(bank, rivals, jobs or cpu_count(), lambda share, line: progress(line, share))
        if report is not None:
            from cockpit.bank.page import write_page

            with writing(report):
                write_page(result, report)
        tell(as_json, result.as_json(), [*in_words(result), *([f"report     {report}"] if report else [])], indent=1)
        return 0 if result.passed else 3

    carry_out(work, as_json)
