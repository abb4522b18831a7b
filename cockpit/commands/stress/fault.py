"""`stickslip fault`: inject a fault of the catalogue into a running loop."""

from typing import Annotated

import typer

from bridge.faults import Fault
from cockpit.commands.as_json.option import Json, print_result
from cockpit.commands.options import BUS, SharedOptions, command


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
    """Inject a fault into a running loop with a simulated rig. A real rig refuses it; its processes must be of this user."""
    from cockpit.faults.catalogue import FaultList, find_entry, known_faults
    from cockpit.faults.injection import inject

    if known:
        catalogue: FaultList = known_faults()
        print_result(as_json, catalogue, catalogue.in_words())
        return
    if not (name or clear):
        raise Fault("CONFIG", "NAME: missing: must be a fault of the catalogue; see `stickslip fault --list`")
    tables = list(find_entry(name).entry.fault) if name else []
    if name and not tables:
        raise Fault(
            "CONFIG",
            f"{name}: is an operator command: must be a fault; see `stickslip {name.split('-')[0]} --help`",
        )
    changed = {} if for_s is None else {"for_s": for_s}
    tables = [
        type(table).model_validate(table.model_dump() | {"name": table.name or name} | changed) for table in tables
    ]
    done = inject(shared.bus(), name or "clear", tables, clear)
    print_result(as_json, done, done.in_words())
