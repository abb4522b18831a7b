"""`stickslip serve` and `watch`: show a running rig in a browser or a terminal."""

import contextlib
import json
import signal
from pathlib import Path
from typing import Annotated

import typer

from bridge.faults import Fault
from cockpit.commands.as_json.option import STDOUT, Json, carry_out
from cockpit.commands.options import DEFAULT_SCENARIO, Certs, Endpoint, Prefix, ScenarioName, as_settings

_Port = Annotated[int, typer.Option(min=0, max=65535, help="Port of the page on 127.0.0.1; 0: any free port.")]
_Log = Annotated[Path | None, typer.Option("--log", hidden=True)]


def _refuse_a_log(command: str, log: Path | None) -> None:
    if log is not None:
        raise Fault("CONFIG", f"--log {log}: {command} shows a running rig; for a log use `stickslip review {log}`")


def _refuse_a_file(command: str, as_json: Json) -> None:
    if as_json not in (None, STDOUT):
        raise Fault(
            "CONFIG", f"--json {as_json}: {command} writes to stdout while it runs; redirect it: --json > {as_json}"
        )


def _never_suspended() -> None:
    """Ignore Ctrl-Z. The rig drops the link of a suspended viewer, and with it 20 to 40 blocks for the other clients."""
    signal.signal(signal.SIGTSTP, signal.SIG_IGN)


def serve(
    port: _Port = 8447,
    scenario: ScenarioName = DEFAULT_SCENARIO,
    endpoint: Endpoint = None,
    prefix: Prefix = None,
    certs: Certs = None,
    foxglove: Annotated[
        bool, typer.Option("--foxglove", help="Also serve the signals to Foxglove and Lichtblick (extra foxglove).")
    ] = False,
    foxglove_port: Annotated[
        int, typer.Option(min=0, max=65535, help="Port for --foxglove on 127.0.0.1; 0: any free port.")
    ] = 8765,
    log: _Log = None,
    as_json: Json = None,
) -> None:
    """Show a rig while it runs, as a page for a browser on this computer; `stickslip review` shows a log.

    Listens like the recorder and is never part of the control loop. The page has STOP; arm, disarm and reset need the token
    that is printed.
    """

    def work() -> None:
        from bridge.plain import say
        from bridge.wire.session import role_security
        from cockpit.live.server import HOST, Server, listening
        from cockpit.live.token import kept_token
        from cockpit.run.child_process import stop_event
        from cockpit.run.scenario_file import load_bus

        _refuse_a_log("serve", log)
        _refuse_a_file("serve", as_json)
        _never_suspended()
        bus = load_bus(scenario, as_settings([], None, endpoint, prefix, certs))
        role_security(bus, "viewer")  # reports a missing certificate before anything is served
        with contextlib.ExitStack() as ending:
            sock = ending.enter_context(listening(port))
            at = int(sock.getsockname()[1])
            other = None
            if foxglove:
                from cockpit.live.foxglove_server import Foxglove

                other = ending.enter_context(Foxglove(foxglove_port))
            word, path = ending.enter_context(kept_token(at))
            viewers = f"ws://{HOST}:{other.port}" if other is not None else ""

            def ready() -> None:
                if as_json is not None:
                    table = {"page": f"http://{HOST}:{at}/", "endpoint": bus.endpoint, "token_file": str(path)}
                    print(json.dumps(table | ({"foxglove": viewers} if viewers else {})), flush=True)
                    return
                say(f"page     http://{HOST}:{at}/ shows the rig at {bus.endpoint}; Ctrl-C ends it")
                if viewers:
                    say(
                        f"foxglove {viewers} is the address for Foxglove and Lichtblick, which can read but not command"
                    )
                say(f"token    {word} arms, disarms and resets from the page; it is in {path}")

            Server(bus, word, at, other.tell if other is not None else None).run(sock, stop_event(), ready)

    carry_out(work, as_json)


def watch(
    scenario: ScenarioName = DEFAULT_SCENARIO,
    endpoint: Endpoint = None,
    prefix: Prefix = None,
    certs: Certs = None,
    every: Annotated[
        float, typer.Option(min=0.05, max=3600.0, metavar="S", help="Seconds between two lines of --json.")
    ] = 1.0,
    log: _Log = None,
    as_json: Json = None,
) -> None:
    """Show a rig while it runs, on one screen of a terminal until Ctrl-C; with --json one line per second on stdout."""

    def work() -> None:
        from bridge.wire.session import role_security
        from cockpit.live.screen import lines, show
        from cockpit.run.child_process import stop_event
        from cockpit.run.scenario_file import load_bus

        _refuse_a_log("watch", log)
        _never_suspended()
        _refuse_a_file("watch", as_json)
        bus = load_bus(scenario, as_settings([], None, endpoint, prefix, certs))
        role_security(bus, "viewer")
        if as_json is None:
            show(bus, stop_event())
        else:
            lines(bus, stop_event(), every)

    carry_out(work, as_json)
