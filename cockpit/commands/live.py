"""`stickslip serve` and `watch`: show a running rig in a browser or a terminal."""

import contextlib
import json
import signal
from typing import TYPE_CHECKING, Annotated

import typer

from bridge.faults import Fault
from cockpit.commands.as_json.option import STDOUT, Json
from cockpit.commands.options import BUS, SharedOptions, command

if TYPE_CHECKING:
    from bridge.wire.bus_config import BusConfig


def _seen_bus(command: str, shared: SharedOptions, as_json: Json) -> "BusConfig":
    """The bus for a viewer. Raises Fault CONFIG or NOT_SECURE before anything is shown."""
    from bridge.wire.session import role_security

    if as_json not in (None, STDOUT):
        raise Fault(
            "CONFIG", f"--json {as_json}: {command} writes to stdout while it runs; redirect it: --json > {as_json}"
        )
    # Ctrl-Z is ignored: the rig drops the link of a suspended viewer, and with it 20 to 40 blocks for the other clients.
    signal.signal(signal.SIGTSTP, signal.SIG_IGN)
    bus = shared.bus()
    role_security(bus, "viewer")
    return bus


@command(*BUS)
def serve(
    shared: SharedOptions,
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Port of the page on 127.0.0.1; 0: any free port.")
    ] = 8447,
    foxglove: Annotated[
        bool, typer.Option("--foxglove", help="Also serve the signals to Foxglove and Lichtblick (extra foxglove).")
    ] = False,
    foxglove_port: Annotated[
        int, typer.Option(min=0, max=65535, help="Port for --foxglove on 127.0.0.1; 0: any free port.")
    ] = 8765,  # default of the connection dialogs of Foxglove and Lichtblick
    as_json: Json = None,
) -> None:
    """Show a rig while it runs, as a page for a browser on this computer; `stickslip review` shows a log.

    Listens like the recorder and is never part of the control loop. The page has STOP; arm, disarm and reset need the token
    that is printed.
    """
    from bridge.plain import print_line
    from cockpit.live.operator_link import kept_token
    from cockpit.live.server import HOST, Server, listening
    from cockpit.run.child_process import stop_event

    bus = _seen_bus("serve", shared, as_json)
    with contextlib.ExitStack() as ending:
        sock = ending.enter_context(listening(port))
        page_port = int(sock.getsockname()[1])
        viewer_server = None
        if foxglove:
            from cockpit.live.foxglove_server import Foxglove

            viewer_server = ending.enter_context(Foxglove(foxglove_port))
        token, path = ending.enter_context(kept_token(page_port))
        viewers = f"ws://{HOST}:{viewer_server.port}" if viewer_server is not None else ""

        def ready() -> None:
            if as_json is not None:
                table = {"page": f"http://{HOST}:{page_port}/", "endpoint": bus.endpoint, "token_file": str(path)}
                print(json.dumps(table | ({"foxglove": viewers} if viewers else {})), flush=True)
                return
            print_line(f"page     http://{HOST}:{page_port}/ shows the rig at {bus.endpoint}; Ctrl-C ends it")
            if viewers:
                print_line(
                    f"foxglove {viewers} is the address for Foxglove and Lichtblick, which can read but not command"
                )
            print_line(f"token    {token} arms, disarms and resets from the page; it is in {path}")

        also = viewer_server.send if viewer_server is not None else None
        Server(bus, token, page_port, also).run(sock, stop_event(), ready)


@command(*BUS)
def watch(
    shared: SharedOptions,
    every: Annotated[
        float, typer.Option(min=0.05, max=3600.0, metavar="S", help="Seconds between two lines of --json.")
    ] = 1.0,
    as_json: Json = None,
) -> None:
    """Show a rig while it runs, on one screen of a terminal until Ctrl-C; with --json one line per second on stdout."""
    from cockpit.live.screen import lines, show
    from cockpit.run.child_process import stop_event

    bus = _seen_bus("watch", shared, as_json)
    if as_json is None:
        show(bus, stop_event())
    else:
        lines(bus, stop_event(), every)
