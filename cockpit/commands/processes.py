"""`stickslip plant`, `controller`, `record` and `stop`: one process of a run, and a person's word to it."""

import sys
from typing import Annotated

import typer

from bridge.faults import Fault
from cockpit.commands.options import (
    DEFAULT_SCENARIO,
    ChildOf,
    Endpoint,
    Lockstep,
    LogFile,
    Prefix,
    ScenarioName,
    Seed,
    Settings,
    as_settings,
)
from cockpit.run.child_process import guarded, stop_event


def plant(
    scenario: ScenarioName = DEFAULT_SCENARIO,
    settings: Settings = [],  # noqa: B006
    seed: Seed = None,
    endpoint: Endpoint = None,
    prefix: Prefix = None,
    lockstep: Lockstep = False,
    wait_for: Annotated[str, typer.Option(help="Roles that must be on the bus before the first block.")] = "controller",
    child: ChildOf = 0,
) -> None:
    """Serve the stand-in rig of a scenario on the bus."""

    def work() -> None:
        from cockpit.run.scenario import header, load_scenario
        from plant.app import run as serve

        made = load_scenario(scenario, as_settings(settings, seed, endpoint, prefix))
        roles = [role for role in wait_for.split(",") if role]
        if unknown := set(roles) - {"controller", "recorder"}:
            raise Fault(
                "CONFIG", f"--wait-for {wait_for}: {min(unknown)}: must be controller, recorder or both, by comma"
            )
        described = header(made, "plant", lockstep)
        serve(made.rig, made.seed, made.duration_s, made.bus, described, roles, lockstep, stop_event(child))

    sys.exit(guarded(work))


def controller(
    scenario: ScenarioName = DEFAULT_SCENARIO,
    settings: Settings = [],  # noqa: B006
    seed: Seed = None,
    endpoint: Endpoint = None,
    prefix: Prefix = None,
    lockstep: Lockstep = False,
    child: ChildOf = 0,
) -> None:
    """Control the rig that is on the bus, with the controller of a scenario."""

    def work() -> None:
        from cockpit.run.scenario import header, load_scenario
        from controller.app import run as control

        made = load_scenario(scenario, as_settings(settings, seed, endpoint, prefix))
        control(made.controller, made.bus, header(made, "controller", lockstep), lockstep, stop_event(child))

    sys.exit(guarded(work))


def record(
    scenario: ScenarioName = DEFAULT_SCENARIO,
    settings: Settings = [],  # noqa: B006
    seed: Seed = None,
    endpoint: Endpoint = None,
    prefix: Prefix = None,
    lockstep: Lockstep = False,
    log: LogFile = None,
    child: ChildOf = 0,
) -> None:
    """Record everything on the bus until the plant ends its run. A log that is there already is renamed, not overwritten."""

    def work() -> None:
        from bridge.log.recorder import run as record_all
        from cockpit.run.run import about_run, keep_aside, log_path
        from cockpit.run.scenario import load_scenario

        made = load_scenario(scenario, as_settings(settings, seed, endpoint, prefix))
        path = log_path(log, made.name)

        def ready() -> None:
            # `stickslip run` writes its log anew; started by hand after an incident, the one there holds what happened
            if not child:
                keep_aside(path)

        about, stop = about_run(made, lockstep), stop_event(child)
        record_all(path, made.bus, ["plant", "controller"], about, lockstep, stop, ready)

    sys.exit(guarded(work))


def operator_stop(
    reset: Annotated[bool, typer.Option("--reset", help="Let the controller work again after a stop.")] = False,
    scenario: ScenarioName = DEFAULT_SCENARIO,
    endpoint: Endpoint = None,
    prefix: Prefix = None,
) -> None:
    """Tell a running controller to ramp the vibration down and keep it down, until --reset; exit status 4: nobody obeyed."""

    def work() -> None:
        from bridge.wire import stickslip_pb2 as wire
        from cockpit.run.operator import tell
        from cockpit.run.scenario import load_scenario

        made = load_scenario(scenario, as_settings([], None, endpoint, prefix))
        tell(made.bus, wire.Operator.RESET if reset else wire.Operator.STOP)

    sys.exit(guarded(work))
