"""`stickslip fmu`: a simulated rig as a model for other tools."""

from pathlib import Path
from typing import Annotated

import typer

from cockpit.commands.as_json.option import Json, print_result
from cockpit.commands.options import SharedOptions, command
from cockpit.run.writable import check_output, writing


@command("settings")
def fmu(
    shared: SharedOptions,
    rig: Annotated[str, typer.Argument(metavar="RIG", help="A simulated rig: a name in deploy/rigs, or a .toml file.")],
    out: Annotated[Path, typer.Option("--out", metavar="FILE.fmu", help="The FMU, FMI 3.0 for co-simulation.")],
    as_json: Json = None,
) -> None:
    """Write a simulated rig as an FMU for Linux on x86-64, which needs no Python: the same bits as the plant's kernel."""
    from cockpit.run.scenario import load_rig
    from plant.fmu.export import export

    check_output("--out", out, (".fmu",))
    made = load_rig(rig, shared.settings)
    with writing(out):
        done = export(made, out)
    print_result(as_json, done, done.in_words())
