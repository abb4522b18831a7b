"""`stickslip run`: plant, controller and recorder to the end of a scenario; `plant`, `controller`, `record`: one of them."""

from typing import Annotated, NamedTuple

import typer

from bridge.faults import Fault
from cockpit.commands.as_json.option import Json, print_result
from cockpit.commands.options import SharedOptions, Strict, Verbose, command
from cockpit.run.child_process import step_reports, stop_event, stopped_once, warn_without_priority
from cockpit.run.writable import LOG, check_output

_OF_A_PROCESS = ("scenario", "settings", "seed", "endpoint", "prefix", "certs", "lockstep", "wait", "child")


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


@command(*_OF_A_PROCESS, "insecure")
def plant(
    shared: SharedOptions,
    wait_for: Annotated[
        str,
        typer.Option(
            help="Roles that must be on the bus before the first block: controller, recorder, or controller,recorder."
        ),
    ] = "controller",
    as_json: Json = None,
) -> None:
    """Simulate the rig of a scenario and serve it on the bus."""
    from bridge.guard.kept import StopLatch
    from cockpit.run.scenario import header, load_scenario, refuse_faults, refuse_short_blocks
    from plant.app import run as serve

    made = load_scenario(shared.scenario, shared.as_settings())
    roles = [role for role in wait_for.split(",") if role]
    if unknown := set(roles) - {"controller", "recorder"}:
        raise Fault(
            "CONFIG",
            f"--wait-for {wait_for}: {min(unknown)}: must be controller, recorder, or controller,recorder",
        )
    if not shared.lockstep:
        refuse_short_blocks(made)
    refuse_faults(made, shared.lockstep)
    if not (shared.lockstep or shared.child):
        warn_without_priority()
    described = header(made, "plant", shared.lockstep)
    # a stop inside `stickslip run` ends with that run; only a plant started alone keeps it over a restart
    latch = StopLatch(f"{made.rig.name} at {made.bus.endpoint}", False) if shared.child else StopLatch(made.rig.name)
    with step_reports(quiet=bool(shared.child)) as report:
        blocks = serve(
            made.rig,
            made.seed,
            made.duration_s,
            made.bus,
            described,
            roles,
            shared.lockstep,
            stop_event(shared.child),
            made.arm,
            None if shared.lockstep else latch,
            made.fault,
            report,
        )
    served = Served("plant", made.bus.endpoint, shared.lockstep, blocks)
    print_result(as_json, served, [served.in_words()])


@command(*_OF_A_PROCESS)
def controller(shared: SharedOptions, as_json: Json = None) -> None:
    """Run the controller of a scenario for the rig on the bus."""
    from cockpit.run.scenario import header, load_scenario, refuse_short_blocks
    from controller.app import run as control

    made = load_scenario(shared.scenario, shared.as_settings())
    if not shared.lockstep:
        refuse_short_blocks(made)
    if not (shared.lockstep or shared.child):
        warn_without_priority()
    described = header(made, "controller", shared.lockstep)
    with step_reports(quiet=bool(shared.child)) as report:
        steps = control(made.controller, made.bus, described, shared.lockstep, stop_event(shared.child), report)
    served = Served("controller", made.bus.endpoint, shared.lockstep, steps)
    print_result(as_json, served, [served.in_words()])


@command(*_OF_A_PROCESS, "log")
def record(shared: SharedOptions, as_json: Json = None) -> None:
    """Record all messages on the bus until the plant ends its run. An existing log is renamed, not overwritten."""
    from bridge.log.recorder import run as record_all
    from cockpit.run.run import about_run, keep_aside, log_path
    from cockpit.run.scenario import load_scenario

    made = load_scenario(shared.scenario, shared.as_settings())
    path = log_path(shared.log, made.name)
    check_output("--log", path, LOG)

    def ready() -> None:
        # Started by hand after an incident, the existing log may be its only record. `stickslip run` replaces its log.
        if not shared.child:
            keep_aside(path)

    if not (shared.lockstep or shared.child):
        warn_without_priority()
    about, stop, roles = about_run(made, shared.lockstep), stop_event(shared.child), ["plant", "controller"]
    with step_reports(quiet=bool(shared.child)) as report:
        record_all(path, made.bus, roles, about, shared.lockstep, stop, ready, made.log.rotation, report)
    print_result(as_json, Recorded(str(path)), [f"log      {path}"])


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
