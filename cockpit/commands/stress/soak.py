"""`stickslip soak`: plant, controller and recorder for hours, with verdict, memory and latency."""

from pathlib import Path
from typing import Annotated

import typer

from bridge.faults import Fault
from cockpit.commands.as_json.option import Json, print_result
from cockpit.commands.options import SharedOptions, command, watched_share
from cockpit.run.child_process import stopped_once

_PAGE = (".md",)


@command("settings", "seed", "endpoint", "prefix", "certs", "log", scenario="belt-axis")
def soak(
    shared: SharedOptions,
    hours: Annotated[float, typer.Option(min=0.0, help="Duration in hours.")] = 0.0,
    minutes: Annotated[float, typer.Option(min=0.0, help="Duration in minutes, added to --hours.")] = 0.0,
    report: Annotated[Path | None, typer.Option(metavar="FILE", help="Report to write, one .md file.")] = None,
    as_json: Json = None,
) -> int:
    """Run a loop for hours: verdict, memory of each process, latency over time; exit status 1: ended early, or lost messages.

    Ctrl-C ends it with a result. Its log is deleted at the end unless --log is given.
    """
    from bridge.files import write_whole
    from cockpit.run.child_process import warn_without_priority
    from cockpit.run.scenario import load_scenario, refuse_short_blocks
    from cockpit.run.soak import soak as run
    from cockpit.run.writable import LOG, check_output, writing

    seconds = 3600.0 * hours + 60.0 * minutes
    if seconds <= 0.0:
        raise Fault("CONFIG", "--hours, --minutes: missing: their sum must be above 0; give one of them")
    changed = shared.as_settings()
    made = load_scenario(shared.scenario, [*changed, f"duration_s={seconds}"])
    refuse_short_blocks(made)
    for path, option, kind in ((report, "--report", _PAGE), (shared.log, "--log", LOG)):
        if path is not None:
            check_output(option, path, kind)
    warn_without_priority()
    arguments = ["--scenario", shared.scenario, *(part for setting in changed for part in ("--set", setting))]
    with stopped_once(), watched_share("soaking", quiet=False) as progress:
        soaked = run(made.name, arguments, made.bus, seconds, shared.log, progress)
    if report is not None:
        with writing(report):
            write_whole(report, soaked.page())
    print_result(as_json, soaked, soaked.in_words())
    return 0 if soaked.good else 1
