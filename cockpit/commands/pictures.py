"""`stickslip plot`, `review`, `map` and `reproduce`: a run, a rig and the paper as pictures and pages."""

import contextlib
import math
from collections.abc import Generator
from pathlib import Path
from typing import Annotated

import typer

from bridge.faults import Fault
from bridge.files import check_file, refuse_to_lose, refuse_to_replace_text
from cockpit.commands.as_json.option import STDOUT, Json, print_result
from cockpit.commands.options import DEFAULT_SCENARIO, command, watched_share
from cockpit.run.writable import CSV, PAGE, PICTURE, check_output, writing


@contextlib.contextmanager
def _written(out: Path, suffixes: tuple[str, ...]) -> Generator[None]:
    """Context of work that ends with writing `out`. Raises Fault if it cannot be written, at the start where possible."""
    check_output("--out", out, suffixes)
    with writing(out):
        yield


@command()
def plot(
    log: Annotated[Path, typer.Argument(help="A log, .mcap, of a run or made by `log import`.")],
    out: Annotated[
        Path | None,
        typer.Option(
            help="Picture to write: .png, .svg or .pdf; if not given, a .png next to LOG with its name.",
            show_default=False,
        ),
    ] = None,
    start: Annotated[str, typer.Option("--from", help="Start time in the run, e.g. 12.5s.")] = "",
    end: Annotated[str, typer.Option("--to", help="End time in the run, e.g. 20s.")] = "",
    signals: Annotated[
        str,
        typer.Option(
            help="Columns, comma-separated, e.g. drive_force_N,amplitude_m; neighbours with the same unit share an axis."
        ),
    ] = "",
    style: Annotated[
        str,
        typer.Option(
            metavar="screen|paper", help="screen: with the verdict as title; paper: no title, small text, one column."
        ),
    ] = "screen",
    width: Annotated[float | None, typer.Option(help="Width in mm; if not given 280 for screen, 85 for paper.")] = None,
    versus: Annotated[Path | None, typer.Option("--vs", help="Second log, drawn over the first.")] = None,
    data: Annotated[Path | None, typer.Option(help="Write the numbers of the curves to this FILE.csv.")] = None,
    as_json: Json = None,
) -> None:
    """Draw the run in a log: drive force, v_a against v_d, and the controller's actions; or any of its signals."""
    from cockpit.figures.curves import FIRST_LINE, request_of
    from cockpit.figures.run_figure import Plotted, draw_logs
    from cockpit.run.replay import time_s

    from_s = time_s(f"--from {start}", start, "12.5s") if start else -math.inf
    to_s = time_s(f"--to {end}", end, "20s") if end else math.inf
    request = request_of(from_s, to_s, signals, style, width)
    logs = [log] if versus is None else [log, versus]
    for path in logs:
        check_file(path, "BAD_LOG", "give the path of a run log, .mcap")
    picture = out or log.parent / f"{log.stem}.png"
    refuse_to_lose(logs, "the log", "--out", picture)
    refuse_to_lose(logs, "the log", "--data", data)
    if data is not None:
        check_output("--data", data, CSV)
        refuse_to_replace_text(data, FIRST_LINE, f"--data {data}")
    with _written(picture, PICTURE):
        verdict = draw_logs(logs, picture, request, data)[0]
    words = [f"picture  {picture}", *([f"data     {data}"] if data is not None else [])]
    print_result(as_json, Plotted(verdict, picture, data), words)


@command()
def review(
    logs: Annotated[
        list[Path], typer.Argument(metavar="LOG...", help="One log, .mcap, or two; the second is drawn over the first.")
    ],
    out: Annotated[
        Path | None, typer.Option(help="Page to write, .html; if not given, next to the first LOG.", show_default=False)
    ] = None,
    as_json: Json = None,
) -> None:
    """Make a page of a log: verdict, curves to zoom into, decisions with reasons, events; two logs are compared."""
    from cockpit.review.page import Reviewed, write_review

    if len(logs) > 2:
        raise Fault("CONFIG", f"{logs[2]}: is the third log: a page shows one or two; leave it out")
    for path in logs:
        check_file(path, "BAD_LOG", "give the path of a run log, .mcap")
    page = out or logs[0].parent / f"{logs[0].stem}.html"
    refuse_to_lose(logs, "the log", "--out", page)
    with _written(page, PAGE):
        verdicts = write_review(logs, page)
    words = [*(f"{verdict.log}: {verdict.headline}" for verdict in verdicts), f"page     {page}"]
    print_result(as_json, Reviewed(page, verdicts), words)


@command()
def stability(
    rig: Annotated[str, typer.Option(help="Name of a rig in deploy/rigs, or a .toml file.")] = DEFAULT_SCENARIO,
    settings: Annotated[
        list[str],
        typer.Option(
            "--set", help="Change one value of the rig: key=value, e.g. contact.static_force_N=18. Repeatable."
        ),
    ] = [],  # noqa: B006
    out: Annotated[Path, typer.Option(help="Picture to write: .png, .svg or .pdf.")] = Path("runs/map.png"),
    as_json: Json = None,
) -> None:
    """Draw where a rig sticks and slips, over drive velocity, stiffness and vibration."""
    from cockpit.figures.stability_map import stability_map
    from cockpit.run.scenario import load_rig

    made = load_rig(rig, settings)
    with _written(out, PICTURE):
        result = stability_map(made, out, [path for path in [Path(rig)] if path.is_file()])
    print_result(as_json, result, [result.answer, f"picture  {out}"])


@command()
def reproduce(
    out: Annotated[Path, typer.Option(help="Report to write, one .html file.")] = Path("runs/reproduce.html"),
    as_json: Json = None,
) -> int:
    """Recompute the paper: its figures, tables and claims, each with its number and whether it holds."""
    from cockpit.paper.page import reproduce as redo

    with _written(out, PAGE), watched_share("reproducing the paper", quiet=as_json == STDOUT) as progress:
        result = redo(out, progress)
    print_result(as_json, result, [result.verdict, f"report   {out}"])
    return 0 if result.passed else 1
