"""`stickslip fmu`: a simulated rig, or a controller, as a model for other tools."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from bridge.faults import Fault
from cockpit.commands.as_json.option import Json, print_result
from cockpit.commands.options import SharedOptions, command
from cockpit.run.writable import check_output, writing


@command("settings")
def fmu(
    shared: SharedOptions,
    rig: Annotated[
        str,
        typer.Argument(
            metavar="RIG", help="A simulated rig: a name in deploy/rigs, or a .toml file. With --controller a scenario."
        ),
    ],
    out: Annotated[Path, typer.Option("--out", metavar="FILE.fmu", help="The FMU, for co-simulation.")],
    fmi: Annotated[
        Literal["2", "3"], typer.Option("--fmi", help="Version of FMI; in 2 an output is its last value and its mean.")
    ] = "3",
    is_controller: Annotated[
        bool, typer.Option("--controller", help="Write the controller of a scenario in place of a rig.")
    ] = False,
    as_json: Json = None,
) -> None:
    """Write a rig or a controller as an FMU for Linux on x86-64, which needs no Python: the same bits as here."""
    from bridge.fmu.export import export

    check_output("--out", out, (".fmu",))
    if is_controller:
        from cockpit.run.device_run import is_real, load_device_run
        from cockpit.run.scenario import load_scenario
        from controller.fmu import model

        if fmi == "2":
            raise Fault("CONFIG", "--fmi 2: has no arrays, which a controller needs as inputs; use --fmi 3")
        run = (
            load_device_run(rig, shared.settings)[0]
            if is_real(rig, shared.settings)
            else load_scenario(rig, shared.settings)
        )
        made = model(run.name, run.controller)
    else:
        from cockpit.run.scenario import load_rig
        from plant.fmu import model as of_rig

        made = of_rig(load_rig(rig, shared.settings))
    with writing(out):
        done = export(made, out, int(fmi))
    print_result(as_json, done, done.in_words())
