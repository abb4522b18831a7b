"""`stickslip bench`: the controller on the scenarios of the bank; rig and controller under the faults of the catalogue."""

from pathlib import Path
from typing import Annotated

import typer

from bridge.files import write_whole
from cockpit.commands.as_json.option import Json, JsonGroup, carry_out, tell
from cockpit.run.child_process import end_like_ctrl_c
from cockpit.run.writable import PAGE, PICTURE, check_output, writing

bench_app = typer.Typer(
    cls=JsonGroup, help="How good is the controller? Judged by what truly happens on made rigs.", no_args_is_help=True
)


@bench_app.command("control")
def bench_control(
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes to use; all cores if not given.")] = None,
    only: Annotated[
        list[str], typer.Option(help="A family of the bank, or how the names of scenarios begin. Repeatable.")
    ] = [],  # noqa: B006
    small: Annotated[bool, typer.Option("--small", help="The small part of the bank alone, some seconds.")] = False,
    drawn: Annotated[
        int | None,
        typer.Option(metavar="SEED", help="In place of the bank: 60 axes drawn from this seed, so of any that is new."),
    ] = None,
    rivals: Annotated[bool, typer.Option(help="Run the rules that need no controller, too.")] = True,
    report: Annotated[Path | None, typer.Option(metavar="FILE", help="Write a report, one .html file.")] = None,
    axes: Annotated[
        Path | None,
        typer.Option("--map", metavar="FILE", help="Draw the runs over feed, stiffness and noise: .png, .svg or .pdf."),
    ] = None,
    as_json: Json = None,
) -> None:
    """Run the controller on the bank, and judge it by the plant's truth; exit status 3: it misses a bar."""

    def work() -> int:
        from joblib import cpu_count

        from cockpit.bank.drawn import drawn_axes
        from cockpit.bank.result import OWN, bench, in_words
        from cockpit.bank.scenario import chosen, load_bank
        from cockpit.commands.diagnose_output import watched

        end_like_ctrl_c()
        if report is not None:
            check_output("--report", report, PAGE)
        if axes is not None:
            check_output("--map", axes, PICTURE)
        bank = chosen(load_bank() if drawn is None else drawn_axes(drawn), only, small)
        with watched() as progress:
            result = bench(bank, rivals, jobs or cpu_count(), lambda share, line: progress(line, share))
        if report is not None:
            from cockpit.bank.page import write_page

            with writing(report):
                write_page(result, report)
        if axes is not None:
            from cockpit.bank.axes_map import draw

            with writing(axes):
                draw(result.scenarios, [one.figures for one in result.done if one.figures.subject == OWN], axes)
        written = [f"{name:<11}{path}" for name, path in (("report", report), ("map", axes)) if path is not None]
        tell(as_json, result.as_json(), [*in_words(result), *written], indent=1)
        return 0 if result.passed else 3

    carry_out(work, as_json)


@bench_app.command("faults")
def bench_faults(
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes to use; all cores if not given.")] = None,
    only: Annotated[
        list[str], typer.Option(help="A group of the catalogue, or how the names of faults begin. Repeatable.")
    ] = [],  # noqa: B006
    report: Annotated[Path | None, typer.Option(metavar="FILE", help="Write the table, one .md file.")] = None,
    as_json: Json = None,
) -> None:
    """Inject the faults of deploy/faults, and judge by the truth of the rig; exit status 1: one is worse than is known."""

    def work() -> int:
        from joblib import cpu_count

        from cockpit.commands.diagnose_output import watched
        from cockpit.faults.bench import bench
        from cockpit.faults.catalogue import chosen, load_catalogue
        from cockpit.faults.page import page

        end_like_ctrl_c()
        if report is not None:
            check_output("--report", report, (".md",))
        wanted = chosen(load_catalogue(), only)
        with watched() as progress:
            result = bench(wanted, jobs or cpu_count(), lambda share, line: progress(line, share))
        if report is not None:
            with writing(report):
                write_whole(report, page(result))
        tell(as_json, result.as_json(), [*result.in_words(), *([f"report   {report}"] if report else [])], indent=1)
        return 1 if result.worse else 0

    carry_out(work, as_json)
