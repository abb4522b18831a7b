"""`stickslip plant`, `controller`, `record`, `stop` and `status`: one process of a run; a person's word to it and look at it."""

from typing import Annotated, NamedTuple

import typer

from bridge.faults import Fault
from cockpit.commands.json_option import Json, carry_out, tell
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
from cockpit.run.child_process import stop_event, warn_without_priority
from cockpit.run.writable import LOG, check_output


class Served(NamedTuple):
    """What a process did on the bus until its end."""

    role: str
    endpoint: str
    lockstep: bool
    blocks: int  # of the plant; steps of the controller, one a block

    def in_words(self) -> str:
        """One line for a person."""
        return f"{self.role:<8} {self.blocks} blocks on {self.endpoint}"


class Recorded(NamedTuple):
    """What `record` wrote."""

    log: str


class Taken(NamedTuple):
    """A word that a controller took."""

    endpoint: str
    taken: str  # the word, and whose it was


def plant(
    scenario: ScenarioName = DEFAULT_SCENARIO,
    settings: Settings = [],  # noqa: B006
    seed: Seed = None,
    endpoint: Endpoint = None,
    prefix: Prefix = None,
    lockstep: Lockstep = False,
    wait_for: Annotated[str, typer.Option(help="Roles that must be on the bus before the first block.")] = "controller",
    child: ChildOf = 0,
    as_json: Json = None,
) -> None:
    """Serve the stand-in rig of a scenario on the bus."""

    def work() -> None:
        from cockpit.run.scenario import header, load_scenario, refuse_what_takes_no_clock
        from plant.app import run as serve

        made = load_scenario(scenario, as_settings(settings, seed, endpoint, prefix))
        roles = [role for role in wait_for.split(",") if role]
        if unknown := set(roles) - {"controller", "recorder"}:
            raise Fault(
                "CONFIG", f"--wait-for {wait_for}: {min(unknown)}: must be controller, recorder or both, by comma"
            )
        if not lockstep:
            refuse_what_takes_no_clock(made)
        if not (lockstep or child):
            warn_without_priority()
        described = header(made, "plant", lockstep)
        blocks = serve(made.rig, made.seed, made.duration_s, made.bus, described, roles, lockstep, stop_event(child))
        served = Served("plant", made.bus.endpoint, lockstep, blocks)
        tell(as_json, served, [served.in_words()])

    carry_out(work, as_json)


def controller(
    scenario: ScenarioName = DEFAULT_SCENARIO,
    settings: Settings = [],  # noqa: B006
    seed: Seed = None,
    endpoint: Endpoint = None,
    prefix: Prefix = None,
    lockstep: Lockstep = False,
    child: ChildOf = 0,
    as_json: Json = None,
) -> None:
    """Control the rig that is on the bus, with the controller of a scenario."""

    def work() -> None:
        from cockpit.run.scenario import header, load_scenario, refuse_what_takes_no_clock
        from controller.app import run as control

        made = load_scenario(scenario, as_settings(settings, seed, endpoint, prefix))
        if not lockstep:
            refuse_what_takes_no_clock(made)
        if not (lockstep or child):
            warn_without_priority()
        steps = control(made.controller, made.bus, header(made, "controller", lockstep), lockstep, stop_event(child))
        served = Served("controller", made.bus.endpoint, lockstep, steps)
        tell(as_json, served, [served.in_words()])

    carry_out(work, as_json)


def record(
    scenario: ScenarioName = DEFAULT_SCENARIO,
    settings: Settings = [],  # noqa: B006
    seed: Seed = None,
    endpoint: Endpoint = None,
    prefix: Prefix = None,
    lockstep: Lockstep = False,
    log: LogFile = None,
    child: ChildOf = 0,
    as_json: Json = None,
) -> None:
    """Record everything on the bus until the plant ends its run. A log that is there already is renamed, not overwritten."""

    def work() -> None:
        from bridge.log.recorder import run as record_all
        from cockpit.run.run import about_run, keep_aside, log_path
        from cockpit.run.scenario import load_scenario

        made = load_scenario(scenario, as_settings(settings, seed, endpoint, prefix))
        path = log_path(log, made.name)
        check_output("--log", path, LOG)

        def ready() -> None:
            # `stickslip run` writes its log anew; started by hand after an incident, the one there holds what happened
            if not child:
                keep_aside(path)

        about, stop = about_run(made, lockstep), stop_event(child)
        record_all(path, made.bus, ["plant", "controller"], about, lockstep, stop, ready)
        tell(as_json, Recorded(str(path)), [f"log      {path}"])

    carry_out(work, as_json)


def operator_stop(
    reset: Annotated[bool, typer.Option("--reset", help="Let the controller work again after a stop.")] = False,
    scenario: ScenarioName = DEFAULT_SCENARIO,
    endpoint: Endpoint = None,
    prefix: Prefix = None,
    as_json: Json = None,
) -> None:
    """Tell a running controller to ramp the vibration down and keep it down, until --reset; exit status 4: nobody obeyed."""

    def work() -> None:
        from bridge.wire import stickslip_pb2 as wire
        from cockpit.run.operator import tell as say
        from cockpit.run.scenario_file import load_bus

        bus = load_bus(scenario, as_settings([], None, endpoint, prefix))
        taken = say(bus, wire.Operator.RESET if reset else wire.Operator.STOP)
        tell(as_json, Taken(bus.endpoint, taken), [f"taken    {taken}"])

    carry_out(work, as_json)


def status(
    scenario: ScenarioName = DEFAULT_SCENARIO,
    endpoint: Endpoint = None,
    prefix: Prefix = None,
    as_json: Json = None,
) -> None:
    """Say what goes on at a rig now, within a second; exit status 1: nobody controls it, 4: no rig answers."""

    def work() -> int:
        from cockpit.run.scenario_file import load_bus
        from cockpit.run.status import look

        seen = look(load_bus(scenario, as_settings([], None, endpoint, prefix)))
        tell(as_json, seen, seen.in_words())
        return 0 if seen.controlled else 1

    carry_out(work, as_json)
