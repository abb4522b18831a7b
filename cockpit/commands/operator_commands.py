"""`stickslip arm`, `disarm`, `stop`, `reset` and `status`: operator commands to a rig, and its state."""

from pathlib import Path
from typing import Annotated

import typer

from cockpit.commands.as_json.option import Json, carry_out, tell
from cockpit.commands.options import DEFAULT_SCENARIO, Certs, Endpoint, Prefix, ScenarioName, as_settings


def _send(
    command: str, scenario: str, endpoint: str | None, prefix: str | None, certs: Path | None, as_json: Json
) -> None:
    def work() -> int:
        from bridge.wire import realtime
        from cockpit.run.operator import tell as send
        from cockpit.run.scenario_file import load_bus

        bus = load_bus(scenario, as_settings([], None, endpoint, prefix, certs))
        realtime.raise_priority()  # a stop must not wait for a core
        answer = send(bus, command)
        tell(as_json, answer, answer.in_words())
        return 0 if answer.done else 1

    carry_out(work, as_json)


def arm(
    scenario: ScenarioName = DEFAULT_SCENARIO,
    endpoint: Endpoint = None,
    prefix: Prefix = None,
    certs: Certs = None,
    accept_gain: Annotated[
        bool,
        typer.Option(
            "--accept-gain", help="Accept the gain of the last check, although it differs from the one before."
        ),
    ] = False,
    as_json: Json = None,
) -> None:
    """Check a rig's sensors and exciter, then allow its controller to vibrate it.

    Exit status 1: the check failed, it measured another gain than the check before, or a fault is active.
    """
    _send("ACCEPT_GAIN" if accept_gain else "ARM", scenario, endpoint, prefix, certs, as_json)


def disarm(
    scenario: ScenarioName = DEFAULT_SCENARIO,
    endpoint: Endpoint = None,
    prefix: Prefix = None,
    certs: Certs = None,
    as_json: Json = None,
) -> None:
    """Ramp a rig's vibration down until it is armed again; exit status 1: the rig was stopped, or did not ramp down."""
    _send("DISARM", scenario, endpoint, prefix, certs, as_json)


def stop(
    reset_too: Annotated[bool, typer.Option("--reset", hidden=True)] = False,
    scenario: ScenarioName = DEFAULT_SCENARIO,
    endpoint: Endpoint = None,
    prefix: Prefix = None,
    certs: Certs = None,
    as_json: Json = None,
) -> None:
    """Ramp a rig's vibration down until `stickslip reset`, over restarts too; exit status 4: no rig confirmed the stop.

    This is a process stop, not an emergency stop: an emergency stop cuts the supply of the amplifier.
    """
    if reset_too:
        typer.echo("stickslip: --reset is now a command: `stickslip reset`, followed by `stickslip arm`", err=True)
    _send("RESET" if reset_too else "STOP", scenario, endpoint, prefix, certs, as_json)


def reset(
    scenario: ScenarioName = DEFAULT_SCENARIO,
    endpoint: Endpoint = None,
    prefix: Prefix = None,
    certs: Certs = None,
    as_json: Json = None,
) -> None:
    """Clear a stop, or a fault whose cause is gone: a rig in FAULT is then DISARMED, until `stickslip arm`.

    Also ends trips of the controller; a rig that is still armed then vibrates again.
    """
    _send("RESET", scenario, endpoint, prefix, certs, as_json)


def status(
    scenario: ScenarioName = DEFAULT_SCENARIO,
    endpoint: Endpoint = None,
    prefix: Prefix = None,
    certs: Certs = None,
    as_json: Json = None,
) -> None:
    """Print the state of a rig, within a second; exit status 1: no controller is in charge, 4: no rig answers."""

    def work() -> int:
        from cockpit.run.scenario_file import load_bus
        from cockpit.run.status import look

        seen = look(load_bus(scenario, as_settings([], None, endpoint, prefix, certs)))
        tell(as_json, seen, seen.in_words())
        return 0 if seen.controlled else 1

    carry_out(work, as_json)
