"""`stickslip arm`, `disarm`, `stop`, `reset` and `status`: operator commands to a rig, and its state."""

from typing import Annotated

import typer

from bridge.faults import Fault
from cockpit.commands.as_json.option import Json, print_result
from cockpit.commands.options import BUS, SharedOptions, command


def _send(command: str, shared: SharedOptions, as_json: Json) -> int:
    from bridge.wire import realtime
    from cockpit.live.operator import send_command

    bus = shared.bus()
    realtime.raise_priority()  # a stop must not wait for a core
    answer = send_command(bus, command)
    print_result(as_json, answer, answer.in_words())
    return 0 if answer.done else 1


@command(*BUS)
def arm(
    shared: SharedOptions,
    accept_gain: Annotated[
        bool,
        typer.Option(
            "--accept-gain", help="Accept the gain of the last check, although it differs from the one before."
        ),
    ] = False,
    as_json: Json = None,
) -> int:
    """Check a rig's sensors and exciter, then allow its controller to vibrate it.

    Exit status 1: the check failed, it measured another gain than the check before, or a fault is active.
    """
    return _send("ACCEPT_GAIN" if accept_gain else "ARM", shared, as_json)


@command(*BUS)
def disarm(shared: SharedOptions, as_json: Json = None) -> int:
    """Ramp a rig's vibration down until it is armed again; exit status 1: the rig was stopped, or did not ramp down."""
    return _send("DISARM", shared, as_json)


@command(*BUS)
def stop(
    shared: SharedOptions,
    reset_too: Annotated[bool, typer.Option("--reset", hidden=True)] = False,
    as_json: Json = None,
) -> int:
    """Ramp a rig's vibration down until `stickslip reset`, over restarts too; exit status 4: no rig confirmed the stop.

    On the computer of the rig its user needs no bus, certificate or password for it. This is a process stop, not an emergency
    stop: an emergency stop cuts the supply of the amplifier.
    """
    if reset_too:
        typer.echo("stickslip: --reset is now a command: `stickslip reset`, followed by `stickslip arm`", err=True)
        return _send("RESET", shared, as_json)
    from bridge.guard.stop_file import confirmed
    from bridge.plain import print_line
    from bridge.wire import realtime
    from cockpit.first_stop import answers, ordered
    from cockpit.live.operator import STOPPED_DIAL_S, send_command, stop_rig

    realtime.raise_priority()
    dial_s = None
    if confirmed(ordered, 0.0):
        dial_s = STOPPED_DIAL_S
        print_line(f"stop     rig {ordered[0].rig} is at rest: it confirmed the stop by file; now over the bus")
    for order in ordered:
        if order.problem:
            print_line(f"stop     no stop by file for rig {order.rig}: {order.problem}; now over the bus")
    try:
        answer = stop_rig(lambda: send_command(shared.bus(), "STOP", dial_s), ordered)
    except Fault as fault:  # no rig confirmed the stop, whatever failed
        raise Fault("NO_PEER", fault.line) from None
    answers.append(answer)
    print_result(as_json, answer, answer.in_words())
    return 0 if answer.done else 1


@command(*BUS)
def reset(shared: SharedOptions, as_json: Json = None) -> int:
    """Clear a stop, or a fault whose cause is gone: a rig in FAULT is then DISARMED, until `stickslip arm`.

    Also ends trips of the controller; a rig that is still armed then vibrates again.
    """
    return _send("RESET", shared, as_json)


@command(*BUS)
def status(shared: SharedOptions, as_json: Json = None) -> int:
    """Print the state of a rig, within a second; exit status 1: no controller is in charge, 4: no rig answers."""
    from cockpit.live.status import look

    seen, lines = look(shared.bus())
    print_result(as_json, seen, lines)
    return 0 if seen.controlled else 1
