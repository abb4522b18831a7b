"""`stickslip arm`, `disarm`, `stop`, `reset` and `status`: a person's word to a rig, and a look at it."""

from pathlib import Path
from typing import Annotated

import typer

from cockpit.commands.as_json.option import Json, carry_out, tell
from cockpit.commands.options import DEFAULT_SCENARIO, Certs, Endpoint, Prefix, ScenarioName, as_settings


def _say(word: str, scenario: str, endpoint: str | None, prefix: str | None, certs: Path | None, as_json: Json) -> None:
    def work() -> int:
        from bridge.wire import realtime
        from cockpit.run.operator import tell as say
        from cockpit.run.scenario_file import load_bus

        bus = load_bus(scenario, as_settings([], None, endpoint, prefix, certs))
        realtime.hasten()  # a stop must not wait for a core
        obeyed = say(bus, word)
        tell(as_json, obeyed, obeyed.in_words())
        return 0 if obeyed.done else 1

    carry_out(work, as_json)


def arm(
    scenario: ScenarioName = DEFAULT_SCENARIO,
    endpoint: Endpoint = None,
    prefix: Prefix = None,
    certs: Certs = None,
    accept_gain: Annotated[
        bool,
        typer.Option("--accept-gain", help="The gain that the last check measured is right, though it is another one."),
    ] = False,
    as_json: Json = None,
) -> None:
    """Check a rig's sensors and exciter, then let its controller vibrate.

    Exit status 1: the check failed, it measured another gain than the one before, or a fault holds.
    """
    _say("ACCEPT_GAIN" if accept_gain else "ARM", scenario, endpoint, prefix, certs, as_json)


def disarm(
    scenario: ScenarioName = DEFAULT_SCENARIO,
    endpoint: Endpoint = None,
    prefix: Prefix = None,
    certs: Certs = None,
    as_json: Json = None,
) -> None:
    """Ramp a rig's vibration down, until it is armed again; exit status 1: the rig was stopped, or it does not obey."""
    _say("DISARM", scenario, endpoint, prefix, certs, as_json)


def stop(
    reset_too: Annotated[bool, typer.Option("--reset", hidden=True)] = False,
    scenario: ScenarioName = DEFAULT_SCENARIO,
    endpoint: Endpoint = None,
    prefix: Prefix = None,
    certs: Certs = None,
    as_json: Json = None,
) -> None:
    """Ramp a rig's vibration down and keep it down, over restarts too, until `stickslip reset`; exit status 4: nobody obeyed.

    This is a process stop and no emergency stop: that one cuts the supply of the amplifier.
    """
    if reset_too:
        typer.echo("stickslip: --reset is now a command: `stickslip reset`, and then `stickslip arm`", err=True)
    _say("RESET" if reset_too else "STOP", scenario, endpoint, prefix, certs, as_json)


def reset(
    scenario: ScenarioName = DEFAULT_SCENARIO,
    endpoint: Endpoint = None,
    prefix: Prefix = None,
    certs: Certs = None,
    as_json: Json = None,
) -> None:
    """Take back a stop, or a fault whose cause is gone: a rig in FAULT is then DISARMED, until `stickslip arm`.

    Trips of the controller end as well; a rig that they left armed stays so, and vibrates again.
    """
    _say("RESET", scenario, endpoint, prefix, certs, as_json)


def status(
    scenario: ScenarioName = DEFAULT_SCENARIO,
    endpoint: Endpoint = None,
    prefix: Prefix = None,
    certs: Certs = None,
    as_json: Json = None,
) -> None:
    """Say what goes on at a rig now, within a second; exit status 1: nobody controls it, 4: no rig answers."""

    def work() -> int:
        from cockpit.run.scenario_file import load_bus
        from cockpit.run.status import look

        seen = look(load_bus(scenario, as_settings([], None, endpoint, prefix, certs)))
        tell(as_json, seen, seen.in_words())
        return 0 if seen.controlled else 1

    carry_out(work, as_json)
