"""`python -m bench control`: the controller on the scenarios of the bank."""

from pathlib import Path
from typing import Annotated

import typer

from cockpit.commands.as_json.option import Json, carry_out, print_result
from cockpit.run.child_process import end_like_ctrl_c
from cockpit.run.writable import PAGE, PICTURE, check_output, writing


def control(
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes to use; all cores if not given.")] = None,
    only: Annotated[
        list[str], typer.Option(help="A family of the bank, or how the names of scenarios begin. Repeatable.")
    ] = [],  # noqa: B006
    small: Annotated[bool, typer.Option("--small", help="The small part of the bank alone, some seconds.")] = False,
    drawn: Annotated[
        int | None,
        typer.Option(metavar="SEED", help="In place of the bank: axes that are drawn at random with this seed."),
    ] = None,
    count: Annotated[int, typer.Option("--axes", min=1, metavar="N", help="Number of axes to draw.")] = 60,
    rivals: Annotated[bool, typer.Option(help="Run the rivals of the controller, too.")] = True,
    report: Annotated[Path | None, typer.Option(metavar="FILE", help="Write a report, one .html file.")] = None,
    axes: Annotated[
        Path | None,
        typer.Option("--map", metavar="FILE", help="Draw the runs over feed, stiffness and noise: .png, .svg or .pdf."),
    ] = None,
    as_json: Json = None,
) -> None:
    """Run the controller on the bank, and judge it by the plant's truth; exit status 1: it misses a bar."""

    def work() -> int:
        from joblib import cpu_count

        from bench.control.drawn import drawn_axes
        from bench.control.result import OWN, bench, in_words
        from bench.control.scenario import chosen, load_bank
        from cockpit.commands.diagnose_output import watched

        end_like_ctrl_c()
        if report is not None:
            check_output("--report", report, PAGE)
        if axes is not None:
            check_output("--map", axes, PICTURE)
        bank = chosen(load_bank() if drawn is None else drawn_axes(drawn, count), only, small)
        with watched() as progress:
            result = bench(bank, rivals, jobs or cpu_count(), lambda share, line: progress(line, share))
        if report is not None:
            from bench.control.page import write_page

            with writing(report):
                write_page(result, report)
        if axes is not None:
            from bench.control.axes_map import draw

            with writing(axes):
                draw(result.scenarios, [run.figures for run in result.done if run.figures.subject == OWN], axes)
        written = [f"{name:<11}{path}" for name, path in (("report", report), ("map", axes)) if path is not None]
        print_result(as_json, result, [*in_words(result), *written], indent=1)
        return 0 if result.passed else 1

    carry_out(work, as_json)
