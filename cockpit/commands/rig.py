"""`stickslip rig ...`: serve and check a real rig and its adapter; simulate a device."""

import threading
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from cockpit.commands.as_json.option import Json, JsonGroup, print_result
from cockpit.commands.options import SharedOptions, command
from cockpit.commands.processes import WaitFor, serve_rig
from cockpit.run.writable import JUNIT, check_output

rig_app = typer.Typer(
    cls=JsonGroup, help="Serve a real rig behind the guard, check it; simulate a device.", no_args_is_help=True
)
RigArgument = Annotated[str, typer.Argument(metavar="RIG", help="A rig file of a real rig, .toml.")]


class Boxed(NamedTuple):
    """Result of `rig box`."""

    port: int


class Released(NamedTuple):
    """Result of `rig release`."""

    by: str  # the process whose test left the rig; empty: the rig was not quarantined


@rig_app.command("serve")
@command("scenario", "settings", "endpoint", "prefix", "certs", "insecure", "wait")
def rig_serve(shared: SharedOptions, rig: RigArgument, wait_for: WaitFor = "controller", as_json: Json = None) -> None:
    """Serve a rig on the bus, as `plant --rig`: open its device behind the guard, or simulate it."""
    serve_rig(shared, rig, wait_for, as_json)


@rig_app.command("check")
@command("settings")
def rig_check(
    shared: SharedOptions,
    rig: RigArgument,
    seconds: Annotated[float, typer.Option("--seconds", min=1.0, max=600.0, metavar="S", help="Length.")] = 5.0,
    as_json: Json = None,
) -> int:
    """Check the device of a rig with its exciter at rest; exit status 0: ok, 1: problems, each with a remedy."""
    from bridge.faults import Fault
    from bridge.rig.check import check
    from bridge.rig.device import reason_of
    from bridge.rig.load import device_of
    from bridge.wire import realtime
    from cockpit.run.device_run import load_device_rig

    made, folder = load_device_rig(rig, shared.settings)
    device = device_of(made, folder)
    try:  # an adapter may be foreign code
        with realtime.raised_priority():
            device.open()
            try:
                result = check(device, made, seconds)
            finally:
                device.close()
    except Exception as error:
        raise Fault("NO_DEVICE", f"{made.name}: {reason_of(error)}") from None
    print_result(as_json, result, result.in_words())
    return 0 if result.ok else 1


@rig_app.command("conformance")
@command("scenario", "settings", "endpoint", "prefix", "certs", "lockstep", "wait")
def rig_conformance(
    shared: SharedOptions,
    rig: Annotated[str | None, typer.Argument(metavar="[RIG]", help="A rig file of a real rig, .toml.")] = None,
    junit: Annotated[Path | None, typer.Option("--junit", metavar="FILE", help="Also write JUnit XML.")] = None,
    as_json: Json = None,
) -> int:
    """Try every duty of an adapter, or of the rig at --endpoint, which vibrates; exit status 1: a check failed."""
    from bridge.faults import Fault
    from bridge.files import write_whole
    from bridge.wire import realtime

    if junit is not None:
        check_output("--junit", junit, JUNIT)
    if (rig is None) == (shared.endpoint is None):
        given = "neither" if rig is None else "both"
        raise Fault("CONFIG", f"RIG, --endpoint: {given} given: must be one; give a rig file, or the address of a rig")
    if rig is not None:
        from bridge.rig.conformance.of_device import conformance
        from bridge.rig.load import device_of
        from cockpit.run.device_run import load_device_rig

        made, folder = load_device_rig(rig, shared.settings)
        realtime.claim(realtime.core(0))
        result = conformance(device_of(made, folder), made)
    else:
        from bridge.rig.conformance.of_client import conformance_of_client

        if not shared.lockstep:
            realtime.claim(realtime.core(1))
        result = conformance_of_client(shared.bus(), shared.lockstep)
    if junit is not None:
        write_whole(junit, result.junit())
    print_result(as_json, result, result.in_words())
    return 0 if result.ok else 1


@rig_app.command("release")
@command()
def rig_release(
    rig: Annotated[str, typer.Argument(metavar="NAME", help="Name of a rig, as the refusal gives it.")],
    as_json: Json = None,
) -> None:
    """Allow tests of a rig again that a test did not bring to rest; look at the rig first."""
    from cockpit.testing.lock import release

    by = release(rig)
    print_result(as_json, Released(by), [f"release  {rig}: {f'was left by {by}' if by else 'was not quarantined'}"])


@rig_app.command("box")
@command()
def rig_box(
    box: Annotated[Path, typer.Argument(metavar="BOX", help="File of a simulated device, .toml.")], as_json: Json = None
) -> None:
    """Simulate a device until Ctrl-C: the plant's physics behind a TCP port, with a dead man, or with a generator."""
    from bridge.config import read_toml, validate
    from bridge.plain import print_line
    from bridge.wire import realtime
    from cockpit.run.child_process import stop_event
    from cockpit.run.scenario import load_rig
    from plant.rig.box import Box, BoxConfig

    config = validate(BoxConfig, read_toml(box), box.name)
    made = Box(config, load_rig(config.rig, config.settings))
    if not config.waits:
        realtime.claim(realtime.core(1))
    if made.generator is not None:
        print_line(f"generator at {config.host}:{made.generator.port}")
    print_line(f"box      {config.rig} at {config.host}:{made.port}")
    stop: threading.Event = stop_event()
    made.run(stop)
    print_result(as_json, Boxed(made.port), [])
