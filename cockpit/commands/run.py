"""`stickslip run`: plant, controller and recorder to the end of a scenario."""

from typing import Annotated

import typer

from cockpit.commands.as_json.option import Json, carry_out, tell
from cockpit.commands.options import (
    DEFAULT_SCENARIO,
    Certs,
    Endpoint,
    Insecure,
    Lockstep,
    LogFile,
    Prefix,
    ScenarioName,
    Seed,
    Settings,
    Strict,
    Verbose,
    Wait,
    as_settings,
)
from cockpit.run.child_process import stopped_once


def run(
    scenario: ScenarioName = DEFAULT_SCENARIO,
    rig: Annotated[
        str | None,
        typer.Option(
            "--rig", metavar="NAME", help="Rig in place of the scenario's: a name in deploy/rigs, or a .toml file."
        ),
    ] = None,
    settings: Settings = [],  # noqa: B006 (typer reads the default and never changes it)
    seed: Seed = None,
    endpoint: Endpoint = None,
    prefix: Prefix = None,
    certs: Certs = None,
    insecure: Insecure = False,
    lockstep: Lockstep = False,
    in_process: Annotated[
        bool,
        typer.Option(
            "--in-process",
            help="Lockstep in one process, without a bus: fastest. With faults 0.4 s of CPU per simulated second.",
        ),
    ] = False,
    log: LogFile = None,
    wait: Wait = None,
    without: Annotated[
        bool, typer.Option("--without", help="Also simulate the same run without the controller, for comparison.")
    ] = False,
    verbose: Verbose = False,
    strict: Strict = False,
    as_json: Json = None,
) -> None:
    """Run plant, controller and recorder through a scenario and judge it; exit status 0: ok, 1: not ok, 14: not judged."""

    def work() -> int:
        from cockpit.judge.verdict_words import strictly
        from cockpit.run.run import run_scenario
        from cockpit.run.scenario_file import rig_setting

        other = [rig_setting(rig)] if rig is not None else []
        changed = [*other, *as_settings(settings, seed, endpoint, prefix, certs, insecure)]
        with stopped_once():
            outcome = run_scenario(scenario, changed, lockstep, in_process, log, wait, without)
            tell(as_json, outcome.as_dict(), [*outcome.in_words(verbose), *strictly(outcome.verdict, strict)])
        return outcome.verdict.exit_status(strict)

    carry_out(work, as_json)
