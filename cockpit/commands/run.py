"""`stickslip run`: plant, controller and recorder to the end of a scenario."""

from typing import Annotated

import typer

from cockpit.commands.as_json.option import Json, print_result
from cockpit.commands.options import SharedOptions, Strict, Verbose, command
from cockpit.run.child_process import stopped_once


@command("scenario", "settings", "seed", "endpoint", "prefix", "certs", "insecure", "lockstep", "log", "wait")
def run(
    shared: SharedOptions,
    rig: Annotated[
        str | None,
        typer.Option(
            "--rig", metavar="NAME", help="Rig in place of the scenario's: a name in deploy/rigs, or a .toml file."
        ),
    ] = None,
    in_process: Annotated[
        bool,
        typer.Option(
            "--in-process",
            help="Lockstep in one process, without a bus: fastest. With faults 0.4 s of CPU per simulated second.",
        ),
    ] = False,
    without: Annotated[
        bool, typer.Option("--without", help="Also simulate the same run without the controller, for comparison.")
    ] = False,
    verbose: Verbose = False,
    strict: Strict = False,
    as_json: Json = None,
) -> int:
    """Run plant, controller and recorder through a scenario and judge it; exit status 0: ok, 1: not ok, 14: not judged."""
    from cockpit.judge.verdict_words import strictly
    from cockpit.run.run import run_scenario
    from cockpit.run.scenario_file import rig_setting

    of_rig = [rig_setting(rig)] if rig is not None else []
    changed = [*of_rig, *shared._replace(wait=None).as_settings()]
    with stopped_once():
        outcome = run_scenario(shared.scenario, changed, shared.lockstep, in_process, shared.log, shared.wait, without)
        print_result(as_json, outcome, [*outcome.in_words(verbose), *strictly(outcome.verdict, strict)])
    return outcome.verdict.exit_status(strict)
