"""`stickslip plot`, `map` and `reproduce`: a run, a rig and the paper as pictures."""

import contextlib
from collections.abc import Generator
from pathlib import Path
from typing import Annotated

import typer

from bridge.files import check_file, refuse_to_lose
from cockpit.commands.json_option import Json, carry_out, tell
from cockpit.commands.options import DEFAULT_SCENARIO
from cockpit.run.writable import PAGE, PICTURE, check_output, writing


@contextlib.contextmanager
def _written(out: Path, suffixes: tuple[str, ...]) -> Generator[None]:
    """The work that ends with writing `out`. Raises Fault where it cannot, at its start if that is known then."""
    check_output("--out", out, suffixes)
    with writing(out):
        out.parent.mkdir(parents=True, exist_ok=True)
        yield


def plot(
    log: Annotated[Path, typer.Argument(help="A run log, .mcap.")],
    out: Annotated[
        Path | None,
        typer.Option(
            help="The picture: .png, .svg or .pdf; if not given, a PNG beside LOG under its name.", show_default=False
        ),
    ] = None,
    as_json: Json = None,
) -> None:
    """Draw the run in a log: drive force, v_a against v_d, and what the controller did."""

    def work() -> None:
        from cockpit.judge.run_plot import plot_run

        check_file(log, "BAD_LOG", "give the path of a run log, .mcap")
        picture = out or log.parent / f"{log.stem}.png"
        refuse_to_lose([log], "the log", "--out", picture)
        with _written(picture, PICTURE):
            verdict = plot_run(log, picture)
        tell(as_json, {"picture": picture} | verdict.as_dict(), [f"picture  {picture}"])

    carry_out(work, as_json)


def stability(
    rig: Annotated[str, typer.Option(help="Name of a rig in deploy/rigs, or a .toml file.")] = DEFAULT_SCENARIO,
    settings: Annotated[
        list[str],
        typer.Option(
            "--set", help="Change one value of the rig: key=value, e.g. contact.static_force_N=18. Repeatable."
        ),
    ] = [],  # noqa: B006
    out: Annotated[Path, typer.Option(help="The picture: .png, .svg or .pdf.")] = Path("runs/map.png"),
    as_json: Json = None,
) -> None:
    """Draw where a rig sticks and slips, over drive velocity, stiffness and vibration."""

    def work() -> None:
        from cockpit.judge.stability_map import stability_map
        from cockpit.run.scenario import load_rig

        made = load_rig(rig, settings)
        with _written(out, PICTURE):
            result = stability_map(made, out)
        tell(as_json, result, [result.answer, f"picture  {out}"])

    carry_out(work, as_json)


def reproduce(
    out: Annotated[Path, typer.Option(help="The report, one .html file.")] = Path("runs/reproduce.html"),
    as_json: Json = None,
) -> None:
    """Redo the paper: its figures, tables and claims, each with its number and whether it holds."""

    def work() -> int:
        from cockpit.paper.page import reproduce as redo

        with _written(out, PAGE):
            result = redo(out, progress=True)
        tell(as_json, result.as_json(), [result.verdict, f"report   {out}"])
        return 0 if result.passed else 1

    carry_out(work, as_json)
