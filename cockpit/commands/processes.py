"""`stickslip plant`, `controller` and `record`: one process of a run."""

from typing import Annotated, NamedTuple

import typer

from bridge.faults import Fault
from cockpit.commands.as_json.option import Json, carry_out, tell
from cockpit.commands.options import (
    DEFAULT_SCENARIO,
    Certs,
    ChildOf,
    Endpoint,
    Insecure,
    Lockstep,
    LogFile,
    Prefix,
    ScenarioName,
    Seed,
    Settings,
    Wait,
    as_settings,
)
from cockpit.run.child_process import stop_event, warn_without_priority
from cockpit.run.lifecycle_lines import telling
from cockpit.run.writable import LOG, check_output


class Served(NamedTuple):
    """Result of a process: the work it did on the bus until its end."""

    role: str
    endpoint: str
    lockstep: bool
    blocks: int  # blocks of the plant, or steps of the controller, one per block

    def in_words(self) -> str:
        """One line for the operator."""
        return f"{self.role:<8} {self.blocks} blocks on {self.endpoint}"


class Recorded(NamedTuple):
    """Result of `record`."""

    log: str


def plant(
    scenario: ScenarioName = DEFAULT_SCENARIO,
    settings: Settings = [],  # noqa: B006
    seed: Seed = None,
    endpoint: Endpoint = None,
    prefix: Prefix = None,
    certs: Certs = None,
    insecure: Insecure = False,
    lockstep: Lockstep = False,
    wait_for: Annotated[
        str, typer.Option(help="Roles that must be on the bus before the first block: controller, recorder, or both.")
    ] = "controller",
    wait: Wait = None,
    child: ChildOf = 0,
    as_json: Json = None,
) -> None:
    """Simulate the rig of a scenario and serve it on the bus."""

    def work() -> None:
        from bridge.guard.latch import StopLatch
        from cockpit.run.scenario import (
            header,
            load_scenario,
            refuse_faults_of_processes,
            refuse_faults_that_take_time,
            refuse_short_blocks,
        )
        from plant.app import run as serve

        made = load_scenario(scenario, as_settings(settings, seed, endpoint, prefix, certs, insecure, wait))
        roles = [role for role in wait_for.split(",") if role]
        if unknown := set(roles) - {"controller", "recorder"}:
            raise Fault(
                "CONFIG",
                f"--wait-for {wait_for}: {min(unknown)}: must be controller, recorder, or both with a comma between",
            )
        if lockstep:
            refuse_faults_that_take_time(made)
        else:
            refuse_short_blocks(made)
            refuse_faults_of_processes(made)
        if not (lockstep or child):
            warn_without_priority()
        described = header(made, "plant", lockstep)
        # a stop inside `stickslip run` ends with that run; only a plant started alone keeps it over a restart
        latch = None if child or lockstep else StopLatch(made.rig.name)
        with telling(quiet=bool(child)) as say:
            blocks = serve(
                made.rig,
                made.seed,
                made.duration_s,
                made.bus,
                described,
                roles,
                lockstep,
                stop_event(child),
                made.arm,
                latch,
                made.fault,
                say,
            )
        served = Served("plant", made.bus.endpoint, lockstep, blocks)
        tell(as_json, served, [served.in_words()])

    carry_out(work, as_json)


def controller(
    scenario: ScenarioName = DEFAULT_SCENARIO,
    settings: Settings = [],  # noqa: B006
    seed: Seed = None,
    endpoint: Endpoint = None,
    prefix: Prefix = None,
    certs: Certs = None,
    lockstep: Lockstep = False,
    wait: Wait = None,
    child: ChildOf = 0,
    as_json: Json = None,
) -> None:
    """Run the controller of a scenario for the rig on the bus."""

    def work() -> None:
        from cockpit.run.scenario import header, load_scenario, refuse_short_blocks
        from controller.app import run as control

        made = load_scenario(scenario, as_settings(settings, seed, endpoint, prefix, certs, wait_s=wait))
        if not lockstep:
            refuse_short_blocks(made)
        if not (lockstep or child):
            warn_without_priority()
        described = header(made, "controller", lockstep)
        with telling(quiet=bool(child)) as say:
            steps = control(made.controller, made.bus, described, lockstep, stop_event(child), say)
        served = Served("controller", made.bus.endpoint, lockstep, steps)
        tell(as_json, served, [served.in_words()])

    carry_out(work, as_json)


def record(
    scenario: ScenarioName = DEFAULT_SCENARIO,
    settings: Settings = [],  # noqa: B006
    seed: Seed = None,
    endpoint: Endpoint = None,
    prefix: Prefix = None,
    certs: Certs = None,
    lockstep: Lockstep = False,
    log: LogFile = None,
    wait: Wait = None,
    child: ChildOf = 0,
    as_json: Json = None,
) -> None:
    """Record all messages on the bus until the plant ends its run. An existing log is renamed, not overwritten."""

    def work() -> None:
        from bridge.log.recorder import run as record_all
        from cockpit.run.run import about_run, keep_aside, log_path
        from cockpit.run.scenario import load_scenario

        made = load_scenario(scenario, as_settings(settings, seed, endpoint, prefix, certs, wait_s=wait))
        path = log_path(log, made.name)
        check_output("--log", path, LOG)

        def ready() -> None:
            # Started by hand after an incident, the existing log may be its only record. `stickslip run` replaces its log.
            if not child:
                keep_aside(path)

        if not (lockstep or child):
            warn_without_priority()
        about, stop, roles = about_run(made, lockstep), stop_event(child), ["plant", "controller"]
        with telling(quiet=bool(child)) as say:
            record_all(path, made.bus, roles, about, lockstep, stop, ready, made.log.rotation, say)
        tell(as_json, Recorded(str(path)), [f"log      {path}"])

    carry_out(work, as_json)
