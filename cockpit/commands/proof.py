"""`stickslip fault`, `soak` and `schema`: inject a fault, run a loop for hours, print the JSON Schema of a format."""

import json
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from bridge.faults import Fault
from bridge.results import write_json
from cockpit.commands.as_json.option import Json, print_result
from cockpit.commands.options import BUS, SharedOptions, command, watched_share
from cockpit.run.child_process import stopped_once
from cockpit.run.writable import check_output_folder, writing

_PAGE = (".md",)


def _entry_names(incomplete: str) -> list[str]:
    from cockpit.faults.catalogue import entry_names

    return entry_names(incomplete)


@command(*BUS)
def fault(
    shared: SharedOptions,
    name: Annotated[
        str, typer.Argument(help="Name of a fault in the catalogue; --list prints all.", autocompletion=_entry_names)
    ] = "",
    for_s: Annotated[
        float | None,
        typer.Option("--for", min=0.0, help="Duration in seconds; 0: until --clear or the end of the run."),
    ] = None,
    clear: Annotated[bool, typer.Option("--clear", help="First end all faults that are active at the rig.")] = False,
    known: Annotated[bool, typer.Option("--list", help="Print the catalogue and every kind of fault.")] = False,
    as_json: Json = None,
) -> None:
    """Inject a fault into a running loop with a simulated rig; a real rig refuses it. Its processes must belong to this user."""
    from bridge.rig.faults.table import FaultTable
    from cockpit.faults.catalogue import FaultList, find_entry, known_faults
    from cockpit.faults.injection import inject
    from cockpit.run.scenario import load_scenario

    if known:
        catalogue: FaultList = known_faults()
        print_result(as_json, catalogue, catalogue.in_words())
        return
    if not (name or clear):
        raise Fault("CONFIG", "NAME: missing: must be a fault of the catalogue; see `stickslip fault --list`")
    tables = load_scenario(find_entry(name).scenario, []).fault if name else []
    if name and not tables:
        raise Fault(
            "CONFIG", f"{name}: is an operator command: must be a fault; see `stickslip {name.split('-')[0]} --help`"
        )
    changed = {} if for_s is None else {"for_s": for_s}
    begin_s = min((table.from_s for table in tables), default=0.0)
    tables = [
        FaultTable.model_validate(
            table.model_dump() | {"name": table.name or name, "from_s": table.from_s - begin_s} | changed
        )
        for table in tables
    ]
    done = inject(shared.bus(), name or "clear", tables, clear)
    print_result(as_json, done, done.in_words())


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


class SchemaName(NamedTuple):
    """A row of the list of schemas."""

    name: str
    about: str


SchemaNames = list[SchemaName]


@command()
def schema(
    name: Annotated[str, typer.Argument(help="For example rig or diagnosis-3; lists all schemas if left out.")] = "",
    out: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Write NAME.json to this folder, or all schemas if NAME is left out."),
    ] = None,
    as_json: Json = None,
) -> None:
    """Print the JSON Schema of a TOML file or a --json result. A TOML file names its schema in line 1: `#:schema PATH`."""
    from cockpit.commands.as_json.schemas import FORMATS

    key = name.replace("/", "-")
    if key and key not in FORMATS:
        raise Fault("CONFIG", f"{name}: no such schema; known: {', '.join(FORMATS)}")
    wanted = [FORMATS[key]] if key else list(FORMATS.values())
    if out is not None:
        check_output_folder("--out", out)
        with writing(out):
            for kind in wanted:
                write_json(out / f"{kind.name}.json", kind.schema())
    names = [SchemaName(kind.name, kind.about) for kind in wanted]
    if out is not None:
        print_result(as_json, names, [f"written  {out / row.name}.json" for row in names])
    elif not key:
        print_result(as_json, names, [f"{row.name:<20} {row.about}" for row in names])
    else:
        made = FORMATS[key].schema()
        print_result(as_json, made, [json.dumps(made, indent=1)], indent=1)
