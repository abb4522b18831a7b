"""`stickslip run`: plant, controller and recorder to the end of a scenario; `plant`, `controller`, `record`: one of them."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from bridge.faults import Fault
from cockpit.commands.as_json.option import Json, print_result
from cockpit.commands.options import SharedOptions, Strict, Verbose, command
from cockpit.run.child_process import step_reports, stop_event, stopped_once, warn_without_priority
from cockpit.run.writable import LOG, check_output

if TYPE_CHECKING:
    from bridge.rig.node import Served as RigToServe
    from bridge.wire import stickslip_pb2 as wire

Rig = Annotated[
    str | None,
    typer.Option(
        "--rig", metavar="NAME", help="Rig in place of the scenario's: a name in deploy/rigs, or a .toml file."
    ),
]
WaitFor = Annotated[
    str,
    typer.Option(
        help="Roles that must be on the bus before the first block: controller, recorder, or controller,recorder."
    ),
]
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
    rig: Rig = None,
    wait_for: WaitFor = "controller",
    as_json: Json = None,
) -> None:
    """Serve the rig of a scenario on the bus: simulate it, or open its device."""
    serve_rig(shared, rig, wait_for, as_json)


def serve_rig(shared: SharedOptions, rig: str | None, wait_for: str, as_json: Json) -> None:
    """Serve a rig on the bus until its end. Raises Fault."""
    from bridge.guard.kept import StopLatch
    from bridge.rig.process import serve

    made, folder = _loaded(shared, rig)
    roles = [role for role in wait_for.split(",") if role]
    if unknown := set(roles) - {"controller", "recorder"}:
        raise Fault(
            "CONFIG",
            f"--wait-for {wait_for}: {min(unknown)}: must be controller, recorder, or controller,recorder",
        )
    if not (shared.lockstep or shared.child):
        warn_without_priority()
    # a stop inside `stickslip run` ends with that run; only a plant started alone keeps it over a restart
    latch = StopLatch(f"{made.rig.name} at {made.bus.endpoint}", False) if shared.child else StopLatch(made.rig.name)
    kept = None if shared.lockstep else latch
    with step_reports(quiet=bool(shared.child)) as report:
        stop = stop_event(shared.child)
        described, to_serve = _described(made, folder, shared.lockstep)
        blocks = serve(to_serve, made.duration_s, made.bus, described, roles, shared.lockstep, stop, kept, report)
    done = Served("plant", made.bus.endpoint, shared.lockstep, blocks)
    print_result(as_json, done, [done.in_words()])


def _described(made: Any, folder: Path | None, lockstep: bool) -> "tuple[wire.Header, RigToServe]":
    """Header and rig of a run, by the folder of a real rig's file; None: simulated. Raises Fault CONFIG."""
    from cockpit.run.run_tables import refuse_for_processes

    if folder is not None:
        from bridge.rig.real import served as real
        from cockpit.run.device_run import device_header

        refuse_for_processes(made, lockstep)
        return device_header(made, "plant", lockstep), real(made.rig, folder, made.fault, made.seed)
    from cockpit.run.scenario import header, refuse_short_blocks
    from plant.rig.node import served as simulated

    if not lockstep:
        refuse_short_blocks(made)
    refuse_for_processes(made, lockstep)
    return header(made, "plant", lockstep), simulated(made.rig, made.seed, made.arm, made.fault)


def _loaded(shared: SharedOptions, rig: str | None) -> "tuple[Any, Path | None]":
    """The scenario of a simulated rig and None, or the run of a real rig and the folder of its file. Raises Fault CONFIG."""
    from cockpit.run.device_run import is_real, load_device_run
    from cockpit.run.scenario_file import rig_setting

    settings = [*([rig_setting(rig)] if rig is not None else []), *shared.as_settings()]
    if is_real(shared.scenario, settings):
        return load_device_run(shared.scenario, settings)
    from cockpit.run.scenario import load_scenario

    return load_scenario(shared.scenario, settings), None


@command(*_OF_A_PROCESS)
def controller(shared: SharedOptions, rig: Rig = None, as_json: Json = None) -> None:
    """Run the controller of a scenario for the rig on the bus."""
    from controller.app import run as control

    made, folder = _loaded(shared, rig)
    if folder is None:
        from cockpit.run.scenario import header, refuse_short_blocks

        if not shared.lockstep:
            refuse_short_blocks(made)
        described = header(made, "controller", shared.lockstep)
    else:
        from cockpit.run.device_run import device_header

        described = device_header(made, "controller", shared.lockstep)
    if not (shared.lockstep or shared.child):
        warn_without_priority()
    with step_reports(quiet=bool(shared.child)) as report:
        steps = control(made.controller, made.bus, described, shared.lockstep, stop_event(shared.child), report)
    served = Served("controller", made.bus.endpoint, shared.lockstep, steps)
    print_result(as_json, served, [served.in_words()])


@command(*_OF_A_PROCESS, "log")
def record(shared: SharedOptions, rig: Rig = None, as_json: Json = None) -> None:
    """Record all messages on the bus until the plant ends its run. An existing log is renamed, not overwritten."""
    from bridge.log.recorder import run as record_all
    from cockpit.run.run import about_run, keep_aside, log_path

    made, _ = _loaded(shared, rig)
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
    rig: Rig = None,
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
