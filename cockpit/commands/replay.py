"""`stickslip replay`: a log through this version's controller, simulated again, or published on the bus."""

from pathlib import Path
from typing import Annotated

import typer

from bridge.faults import Fault
from bridge.files import refuse_to_lose
from bridge.plain import plain
from bridge.units import counted
from cockpit.commands.as_json.option import STDOUT, Json, print_result
from cockpit.commands.options import SharedOptions, command
from cockpit.run.child_process import stop_event
from cockpit.run.writable import LOG, check_output


def _refuse(options: dict[str, bool], why: str) -> None:
    """Raise Fault CONFIG for the first option that is given."""
    for option, is_given in options.items():
        if is_given:
            raise Fault("CONFIG", f"{option}: {why}")


@command("endpoint", "prefix", "certs", "insecure")
def replay_command(
    shared: SharedOptions,
    logs: Annotated[list[Path], typer.Argument(help="Run logs, .mcap.")],
    settings: Annotated[
        list[str],
        typer.Option(
            "--set", help="Change one value of the controller: key=value, or key=value@20s from 20 s on. Repeatable."
        ),
    ] = [],  # noqa: B006
    start: Annotated[
        str, typer.Option("--from", help="Start time, e.g. 12.5s; the replay begins at the last snapshot before it.")
    ] = "0s",
    closed_loop: Annotated[
        bool, typer.Option("--closed-loop", help="Simulate the run again from the log's own plant and seed.")
    ] = False,
    to_bus: Annotated[bool, typer.Option("--to-bus", help="Publish the log on the bus again, in real time.")] = False,
    speed: Annotated[
        float | None,
        typer.Option(min=0.01, max=1000.0, help="With --to-bus: speed as a multiple of real time; 1 if not given."),
    ] = None,
    everything: Annotated[
        bool, typer.Option("--all", help="With --to-bus: publish the controller's topics too, for viewers.")
    ] = False,
    wait: Annotated[
        bool, typer.Option("--wait", help="With --to-bus: begin when a controller and a recorder are on the bus.")
    ] = False,
    log: Annotated[
        Path | None, typer.Option("--log", help="With --closed-loop: log to write; runs/closed-loop.mcap if not given.")
    ] = None,
    as_json: Json = None,
) -> int:
    """Feed a log to this version's controller; exit status 0: the same bits, 1: the first difference, or a damaged log."""
    from bridge.log.logfile import check_log_file
    from cockpit.run import replay as replaying

    from_s = replaying.time_s(f"--from {start}", start, "12.5s")
    if to_bus:
        changed = {"--closed-loop": closed_loop, "--json": as_json is not None, "--set": bool(settings)}
        _refuse(changed, "not with --to-bus, which publishes the log unchanged; leave one of them out")
    else:
        paced = {"--speed": speed is not None, "--all": everything, "--wait": wait}
        meeting = {f"--{name}": getattr(shared, name) is not None for name in ("endpoint", "prefix", "certs")}
        meeting["--insecure"] = shared.insecure
        _refuse(paced | meeting, "only with --to-bus, which publishes the log on the bus; add that, or leave it out")
    if not closed_loop:
        _refuse(
            {"--log": log is not None}, "only with --closed-loop, which writes a new log; add that, or leave it out"
        )
    out = log or Path("runs/closed-loop.mcap")
    if closed_loop:
        check_output("--log", out, LOG)
    for path in logs:  # all logs are checked before the work on the first
        check_log_file(path)
    if to_bus:
        from cockpit.run.log_to_bus import publish_log

        bus = shared.bus()
        roles = ["controller", "recorder"] if wait else []
        stop = stop_event()
        for path in logs:
            if not stop.is_set():
                publish_log(path, bus, speed or 1.0, from_s, everything, roles, stop)
        return 0
    if closed_loop:
        if len(logs) != 1:
            raise Fault(
                "CONFIG",
                f"--closed-loop: {counted(len(logs), 'log')}: must be one log; the new run goes to --log {out}",
            )
        if from_s > 0.0:
            line = f"--from {start}: not with --closed-loop, which simulates the run from its start; leave it out"
            raise Fault("CONFIG", line)
        refuse_to_lose(logs, "the recorded run", "--log", out)
        compared = replaying.closed_loop(logs[0], settings, out)
        print_result(as_json, compared, compared.in_words())
        return 0
    replayed: list[replaying.Replayed] = []
    for path in logs:
        replayed.append(replaying.replay_log(path, from_s, settings))
        if as_json != STDOUT:
            print(plain("\n".join(replayed[-1].in_words())), flush=True)  # printed now, as the next log may be damaged
    print_result(as_json, replayed, [])
    return 0 if all(result.identical and not result.damage for result in replayed) else 1
